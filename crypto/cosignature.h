// Cosignatures of witnesses on checkpoints (C2SP tlog-cosignature.md, "cosignature/v1" with Ed25519 and
// "subtree/v1" with ML-DSA-44): at a stated time, the largest consistent tree that the witness had seen of a
// log had this root. Values are immutable; functions are pure and thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "crypto/ml_dsa.h"
#include "crypto/note_format.h"
#include "crypto/signed_note.h"
#include "crypto/signing_key.h"

namespace kiroku::crypto {

enum class CosignatureAlgorithm { kEd25519, kMlDsa44 };

/// A witness's name and key: "<name>+<key id>+<base64 of a byte for the algorithm and the key>". The byte is
/// 0x04 before the 32 bytes of an Ed25519 key, 0x06 before the 1312 of an ML-DSA-44 key.
class CosignerKey {
 public:
  /// `name` as of VerifierKey; throws kiroku::UsageError.
  CosignerKey(std::string name, const Ed25519PublicKey& key);
  /// A name has at most 255 bytes with ML-DSA-44, which signs it; throws kiroku::UsageError.
  static CosignerKey of_ml_dsa_44(std::string name, ByteView key);
  /// Throws kiroku::UsageError naming what is wrong; the key of a log (0x01) is no cosigner's.
  static CosignerKey parse(std::string_view text);
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] CosignatureAlgorithm algorithm() const { return algorithm_; }
  [[nodiscard]] const Bytes& key() const { return key_; }
  /// First four bytes of SHA-256(name ‖ "\n" ‖ algorithm ‖ key), big endian.
  [[nodiscard]] std::uint32_t key_id() const;
  [[nodiscard]] std::string to_string() const;
  friend bool operator==(const CosignerKey&, const CosignerKey&) = default;

 private:
  CosignerKey(std::string name, CosignatureAlgorithm algorithm, Bytes key);
  std::string name_;
  CosignatureAlgorithm algorithm_;
  Bytes key_;
};

/// The signature line, with its newline, of a cosignature over the note's text. `time_s`: POSIX time, at most
/// 2^63 - 1 and not 0, else kiroku::UsageError.
std::string cosign(std::string_view text, const std::string& name, const SigningKey& key,
                   std::uint64_t time_s);
/// The same by ML-DSA-44, over what the first three lines of a checkpoint say: extension lines are not
/// signed. kiroku::UsageError, too, for what can_cosign_by_ml_dsa() refuses, and for a key of another set.
std::string cosign(std::string_view text, const std::string& name, const MlDsaPrivateKey& key,
                   std::uint64_t time_s);
/// Whether the text is a checkpoint whose origin has at most 255 bytes.
bool can_cosign_by_ml_dsa(std::string_view text);

/// What a note says of one witness.
struct CosignatureCheck {
  enum class State {
    kAbsent,   // no line of this key
    kInvalid,  // a line of this key that is not its signature: the note is malformed
    kValid,
  };
  State state = State::kAbsent;
  std::uint64_t time_s = 0;  // of a valid one
};
/// `note` is the whole note; one that is no signed note has no cosignatures.
CosignatureCheck check_cosignature(std::string_view note, const CosignerKey& cosigner);
/// The same of a note that was parsed already, for whoever asks for many witnesses.
CosignatureCheck check_cosignature(const NoteParts& parts, const CosignerKey& cosigner);

/// Origin, size and root of a log that is not ours: extension lines are allowed, and say nothing here.
std::optional<Checkpoint> parse_extended_checkpoint(std::string_view text);

}  // namespace kiroku::crypto
