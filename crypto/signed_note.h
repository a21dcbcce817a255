// C2SP signed notes (signed-note.md) with Ed25519 signatures, and tlog checkpoints (tlog-checkpoint.md)
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

/// Key name and public key: "<name>+<key id, 8 hex digits>+<base64 of 0x01 and the 32-byte key>".
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
  friend bool operator==(const VerifierKey&, const VerifierKey&) = default;

 private:
  std::string name_;
  Ed25519PublicKey key_;
};

/// The whole note: `text` (must end in a newline), a blank line, one signature line "— <name> <base64>".
std::string sign_note(std::string_view text, const std::string& name, const SigningKey& key);

enum class NoteFailure { kMalformed, kUnknownKey, kBadSignature };
struct OpenedNote {
  std::string text;                    // what was signed, empty if malformed
  std::vector<std::string> signers;    // names on the signature lines
  std::vector<std::string> unchecked;  // "<name>+<key id>" of lines by keys that were not given
  std::optional<NoteFailure> failure;  // nothing: signed by one of the verifiers
  std::string explanation;             // one sentence when it failed
};
/// Checks form and signature. Two lines of one key are no form. A signature by a known key that does not
/// verify fails the whole note, and so does one in a known name by another key; those by unknown names are
/// not checked: whoever can write the note can add them.
OpenedNote open_note(std::string_view note, const std::vector<VerifierKey>& verifiers);

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
