// C2SP signed notes (signed-note.md) with Ed25519 signatures, beside them ML-DSA-65 signatures and signatures
// by hardware (ECDSA on P-256) of devices that have such keys, and tlog checkpoints (tlog-checkpoint.md)
// inside them. Values are immutable; functions are pure and thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "crypto/hash.h"
#include "crypto/signing_key.h"

namespace kiroku::crypto {

/// The ML-DSA-65 key (FIPS 204) with which a device signs beside its Ed25519 key. Its name is the device's
/// and "/ml-dsa-65": verifiers from before take such a line for a cosignature. signed-note.md assigns no type
/// to ML-DSA-65, so the type is 0xff followed by "kiroku/ml-dsa-65", as it recommends. The note's text is
/// signed whole, with an empty context.
class MlDsaVerifierKey {
 public:
  /// `device` as a name of VerifierKey; throws kiroku::UsageError, also for a key that has not 1952 bytes.
  MlDsaVerifierKey(const std::string& device, ByteView key);
  /// Of "<device>/ml-dsa-65+<key id>+<base64 of the type and the key>"; throws kiroku::UsageError naming what
  /// is wrong.
  static MlDsaVerifierKey parse(std::string_view text);
  [[nodiscard]] const std::string& name() const { return name_; }
  /// What such a key of the device is called.
  static std::string name_of(const std::string& device);
  [[nodiscard]] std::string device() const;
  [[nodiscard]] const Bytes& key() const { return key_; }
  [[nodiscard]] std::uint32_t key_id() const { return key_id_; }
  [[nodiscard]] std::string to_string() const;
  friend bool operator==(const MlDsaVerifierKey&, const MlDsaVerifierKey&) = default;

 private:
  std::string name_;
  Bytes key_;
  std::uint32_t key_id_ = 0;
};

/// The key in a device's hardware (crypto/hardware_key.h) that signs beside its Ed25519 key. Its name is the
/// device's and "/ecdsa-p256", its type 0x02 of signed-note.md: ECDSA over SHA-256 of the note's text, DER.
/// As that type has it, the key id is the first four bytes of SHA-256 over the DER of the key alone.
class HardwareVerifierKey {
 public:
  /// `device` as a name of VerifierKey; throws kiroku::UsageError, also for what is no key on P-256.
  HardwareVerifierKey(const std::string& device, ByteView key);
  /// Of "<device>/ecdsa-p256+<key id>+<base64 of 0x02 and the DER>"; throws kiroku::UsageError naming what is
  /// wrong.
  static HardwareVerifierKey parse(std::string_view text);
  [[nodiscard]] const std::string& name() const { return name_; }
  /// What such a key of the device is called.
  static std::string name_of(const std::string& device);
  [[nodiscard]] std::string device() const;
  [[nodiscard]] const P256PublicKey& key() const { return key_; }
  [[nodiscard]] std::uint32_t key_id() const { return key_id_; }
  [[nodiscard]] std::string to_string() const;
  friend bool operator==(const HardwareVerifierKey&, const HardwareVerifierKey&) = default;

 private:
  std::string name_;
  P256PublicKey key_;
  std::uint32_t key_id_ = 0;
};

/// Key name and public key: "<name>+<key id, 8 hex digits>+<base64 of 0x01 and the 32-byte key>". Of a device
/// it may know the ML-DSA-65 key and the key in hardware, too: then all must have signed. Two are equal that
/// have one name and one Ed25519 key.
class VerifierKey {
 public:
  /// `name` must be non-empty, without space, '+', newline or control characters; throws kiroku::UsageError.
  VerifierKey(std::string name, const Ed25519PublicKey& key);
  /// Throws kiroku::UsageError naming what is wrong (key id that is not the key's, other algorithm, …).
  static VerifierKey parse(std::string_view text);
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const Ed25519PublicKey& key() const { return key_; }
  /// First four bytes of SHA-256(name ‖ "\n" ‖ 0x01 ‖ key), big endian.
  [[nodiscard]] std::uint32_t key_id() const;
  [[nodiscard]] std::string to_string() const;

  /// The same key, of a device that signs with `key`, too, since its appliance log had `since` entries: 0 if
  /// it always did. Throws kiroku::UsageError if that is another device's.
  [[nodiscard]] VerifierKey with_ml_dsa(MlDsaVerifierKey key, std::uint64_t since) const;
  [[nodiscard]] const std::optional<MlDsaVerifierKey>& ml_dsa() const { return ml_dsa_; }
  /// Entries that the appliance log had when the device began to sign with both; 0 without such a key.
  [[nodiscard]] std::uint64_t ml_dsa_since() const { return ml_dsa_since_; }

  /// The same for a key in hardware. `root_then` is the log's root at `since` entries, where that is stated:
  /// these entries, and no others, are from before the key.
  [[nodiscard]] VerifierKey with_hardware(HardwareVerifierKey key, std::uint64_t since,
                                          const std::optional<Sha256Digest>& root_then = std::nullopt) const;
  [[nodiscard]] const std::optional<HardwareVerifierKey>& hardware() const { return hardware_; }
  [[nodiscard]] std::uint64_t hardware_since() const { return hardware_since_; }
  [[nodiscard]] const std::optional<Sha256Digest>& log_root_before_hardware() const {
    return log_root_before_hardware_;
  }
  friend bool operator==(const VerifierKey& a, const VerifierKey& b) {
    return a.name_ == b.name_ && a.key_ == b.key_;
  }

 private:
  std::string name_;
  Ed25519PublicKey key_;
  std::optional<MlDsaVerifierKey> ml_dsa_;
  std::uint64_t ml_dsa_since_ = 0;
  std::optional<HardwareVerifierKey> hardware_;
  std::uint64_t hardware_since_ = 0;
  std::optional<Sha256Digest> log_root_before_hardware_;
};

/// With the keys that sign beside that a device's signing key has, since the beginning.
VerifierKey verifier_key_of(const std::string& name, const SigningKey& key);

/// The whole note: `text` (must end in a newline), a blank line, a signature line "— <name> <base64>" by
/// Ed25519, one by ML-DSA-65 where the key has such a half, and one by the key's hardware, if it has one, it
/// is asked and it answers.
struct SignedNote {
  std::string note;
  std::string hardware_silent;  // why the line by hardware is not there though it was asked for, else empty
};
enum class AskHardware { kYes, kNo };
SignedNote sign_note_by_all(std::string_view text, const std::string& name, const SigningKey& key,
                            AskHardware ask = AskHardware::kYes);
/// The note alone.
std::string sign_note(std::string_view text, const std::string& name, const SigningKey& key);

enum class NoteFailure {
  kMalformed,
  kUnknownKey,
  kBadSignature,
  /// A known key signed by Ed25519, and by its ML-DSA key, which is known, nobody did. Only whoever knows
  /// that the note is from before the device had that key may take it.
  kLacksMlDsa,
  /// All that but the key in hardware signed, which is known. The hardware may not have answered, or somebody
  /// has a copy of the other keys: only a later note that it signed can tell.
  kLacksHardware,
};
struct OpenedNote {
  std::string text;                    // what was signed, empty if malformed
  std::vector<std::string> signers;    // names on the signature lines
  std::vector<std::string> unchecked;  // "<name>+<key id>" of lines by keys that were not given
  std::optional<NoteFailure> failure;  // nothing: signed by one of the verifiers, by all keys of it
  bool by_ml_dsa = false;              // and one of these was an ML-DSA key
  bool by_hardware = false;            // and one of these was in hardware; both also where the other lacks
  std::string explanation;             // one sentence when it failed
};
/// Checks form and signatures. Two lines of one key are no form. A signature by a known key that does not
/// verify fails the whole note, and so does one in a known name by another key; those by unknown names are
/// not checked: whoever can write the note can add them.
OpenedNote open_note(std::string_view note, const std::vector<VerifierKey>& verifiers);

/// Whether a note that was opened with `device` alone is signed as that device signed its appliance log when
/// it had `size` entries: by Ed25519 alone until it got an ML-DSA key. Whether its hardware signed is not
/// asked: where it did not answer, the log goes on.
bool is_signed_for_log(const OpenedNote& opened, const VerifierKey& device, std::uint64_t size);

/// Origin, size and root of a log (C2SP tlog-checkpoint): three lines; extension lines are refused here.
struct Checkpoint {
  std::string origin;
  std::uint64_t size = 0;
  Sha256Digest root{};
  [[nodiscard]] std::string to_text() const;
  static std::optional<Checkpoint> parse(std::string_view text);
  friend bool operator==(const Checkpoint&, const Checkpoint&) = default;
};

}  // namespace kiroku::crypto
