// Cosignatures of witnesses on checkpoints (C2SP tlog-cosignature.md, "cosignature/v1" with Ed25519): at a
// stated time, the largest consistent tree that the witness had seen of a log had this root. Values are
// immutable; functions are pure and thread-safe. ML-DSA-44 cosignatures are not known here.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "crypto/note_format.h"
#include "crypto/signed_note.h"
#include "crypto/signing_key.h"

namespace kiroku::crypto {

/// A witness's name and key: "<name>+<key id>+<base64 of 0x04 and the 32-byte key>".
class CosignerKey {
 public:
  /// `name` as of VerifierKey; throws kiroku::UsageError.
  CosignerKey(std::string name, const Ed25519PublicKey& key);
  /// Throws kiroku::UsageError naming what is wrong; the key of a log (0x01) is no cosigner's.
  static CosignerKey parse(std::string_view text);
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const Ed25519PublicKey& key() const { return key_; }
  /// First four bytes of SHA-256(name ‖ "\n" ‖ 0x04 ‖ key), big endian.
  [[nodiscard]] std::uint32_t key_id() const;
  [[nodiscard]] std::string to_string() const;

 private:
  std::string name_;
  Ed25519PublicKey key_;
};

/// The signature line, with its newline, of a cosignature over the note's text. `time_s`: POSIX time, at most
/// 2^63 - 1 and not 0, else kiroku::UsageError.
std::string cosign(std::string_view text, const std::string& name, const SigningKey& key,
                   std::uint64_t time_s);

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
