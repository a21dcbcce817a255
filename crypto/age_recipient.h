// Recipients and identities of age v1 files (C2SP age): who a file key is wrapped for, and who can unwrap it.
// All classes are immutable after construction and safe to use from several threads.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/bytes.h"
#include "crypto/secret.h"

namespace kiroku::crypto {

inline constexpr std::size_t kFileKeySize = 16;

/// One recipient stanza of an age header: "-> type argument…" and its body.
struct AgeStanza {
  std::string type;
  std::vector<std::string> arguments;
  Bytes body;
};

/// Someone a file is sealed to.
class AgeRecipient {
 public:
  virtual ~AgeRecipient() = default;
  [[nodiscard]] virtual AgeStanza wrap(const Secret& file_key) const = 0;
  /// A scrypt recipient must stand alone in a file (age specification).
  [[nodiscard]] virtual bool must_be_alone() const { return false; }
  /// A file is sealed to post-quantum recipients only, or to others only: one of the others would undo it.
  [[nodiscard]] virtual bool is_post_quantum() const { return false; }
  /// "age1…", or "passphrase".
  [[nodiscard]] virtual std::string to_string() const = 0;
};

/// Someone who can open files.
class AgeIdentity {
 public:
  virtual ~AgeIdentity() = default;
  /// The file key, or nothing if none of the stanzas is for this identity. Throws kiroku::Error if a stanza
  /// of its own type is malformed (which makes the whole file invalid).
  [[nodiscard]] virtual std::optional<Secret> unwrap(const std::vector<AgeStanza>& stanzas) const = 0;
  /// "age1…", to whom a file is sealed that it opens; empty where that has no name: a passphrase, an identity
  /// that somebody else holds.
  [[nodiscard]] virtual std::string recipient() const { return {}; }
};

using AgeRecipients = std::vector<std::shared_ptr<const AgeRecipient>>;
using AgeIdentities = std::vector<std::shared_ptr<const AgeIdentity>>;

/// X25519 recipient from "age1…", or a post-quantum one from "age1pq1…" (see age_hybrid.h); throws
/// kiroku::UsageError naming the text if it is neither.
std::shared_ptr<const AgeRecipient> parse_recipient(std::string_view text);
/// A recipients file (-R): one recipient a line, '#' comments and blank lines skipped; errors name the line.
AgeRecipients parse_recipients(std::string_view text, const std::string& name_for_errors);
/// Recipient for a passphrase (scrypt); `work_factor` is log2 of N, age writes 18.
std::shared_ptr<const AgeRecipient> passphrase_recipient(const Secret& passphrase, int work_factor = 18);

/// A newly generated X25519 key pair.
struct AgeKeyPair {
  Secret identity_text;   // "AGE-SECRET-KEY-1…"
  std::string recipient;  // "age1…"
};
AgeKeyPair generate_age_key();
/// The recipient of an AGE-SECRET-KEY-1… or AGE-SECRET-KEY-PQ-1… text.
std::string recipient_of(std::string_view identity_text);

/// Identity from "AGE-SECRET-KEY-1…" or "AGE-SECRET-KEY-PQ-1…". Throws kiroku::UsageError, which does not
/// repeat the text.
std::shared_ptr<const AgeIdentity> parse_identity(std::string_view text);
/// Identity that opens passphrase files; refuses work factors above `maximum_work_factor` before doing the
/// work.
std::shared_ptr<const AgeIdentity> passphrase_identity(const Secret& passphrase,
                                                       int maximum_work_factor = 22);

/// An identity file as age-keygen writes it (comments, one or more secret keys), or the same sealed with a
/// passphrase: `ask_passphrase` is called only then. Throws kiroku::Error for a wrong passphrase or a file
/// that is no identity.
using AskPassphrase = std::function<Secret(const std::string& what_for)>;
AgeIdentities load_identity_file(const std::filesystem::path& file, const AskPassphrase& ask_passphrase);

}  // namespace kiroku::crypto
