// The scrypt recipient type of age: a file key wrapped under a passphrase.
#include <charconv>
#include <limits>

#include "base/error.h"
#include "crypto/age_recipient.h"
#include "crypto/encoding.h"
#include "crypto/file_key_wrap.h"
#include "crypto/key_derivation.h"

namespace kiroku::crypto {
namespace {

constexpr std::string_view kStanzaType = "scrypt";
constexpr std::string_view kSaltLabel = "age-encryption.org/v1/scrypt";
constexpr std::size_t kSaltSize = 16;
constexpr int kLargestWorkFactor = 30;  // a TiB of memory, no machine's

Secret wrap_key(const Secret& passphrase, ByteView salt, int work_factor) {
  Bytes labelled_salt = to_bytes(kSaltLabel);
  append(labelled_salt, salt);
  return scrypt(passphrase.bytes(), labelled_salt, work_factor);
}

void require_work_factor(int work_factor) {
  if (work_factor < 1 || work_factor > kLargestWorkFactor)
    throw UsageError("the work factor of a passphrase must be from 1 to 30, not " +
                     std::to_string(work_factor));
}

class PassphraseRecipient : public AgeRecipient {
 public:
  PassphraseRecipient(const Secret& passphrase, int work_factor)
      : passphrase_(passphrase.clone()), work_factor_(work_factor) {
    require_work_factor(work_factor);
    if (passphrase.empty()) throw UsageError("the passphrase is empty; choose one");
  }
  [[nodiscard]] AgeStanza wrap(const Secret& file_key) const override {
    Bytes salt(kSaltSize);
    fill_random(salt);
    return {std::string(kStanzaType),
            {to_base64(salt, Base64Padding::kUnpadded), std::to_string(work_factor_)},
            wrap_file_key(wrap_key(passphrase_, salt, work_factor_), file_key)};
  }
  [[nodiscard]] bool must_be_alone() const override { return true; }
  [[nodiscard]] std::string to_string() const override { return "passphrase"; }

 private:
  Secret passphrase_;
  int work_factor_;
};

// Digits without a leading zero, as the specification demands; nothing for anything else. Numbers too large
// to count come back as the largest one.
std::optional<int> parse_work_factor(std::string_view text) {
  if (text.empty() || text.front() == '0') return std::nullopt;
  for (const char c : text)
    if (c < '0' || c > '9') return std::nullopt;
  int value = 0;
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  return result.ec == std::errc() ? value : std::numeric_limits<int>::max();
}

class PassphraseIdentity : public AgeIdentity {
 public:
  PassphraseIdentity(const Secret& passphrase, int maximum_work_factor)
      : passphrase_(passphrase.clone()), maximum_work_factor_(maximum_work_factor) {
    require_work_factor(maximum_work_factor);
  }
  [[nodiscard]] std::optional<Secret> unwrap(const std::vector<AgeStanza>& stanzas) const override {
    for (const auto& stanza : stanzas) {
      if (stanza.type != kStanzaType) continue;
      require_stanza(stanzas.size() == 1, stanza, "does not stand alone");
      return unwrap(stanza);
    }
    return std::nullopt;
  }

 private:
  [[nodiscard]] std::optional<Secret> unwrap(const AgeStanza& stanza) const {
    require_stanza(stanza.arguments.size() == 2, stanza, "has not two arguments");
    const auto salt = from_base64(stanza.arguments[0], Base64Padding::kUnpadded);
    require_stanza(salt && salt->size() == kSaltSize, stanza,
                   "has a salt that is not 16 bytes of canonical base64");
    const auto work_factor = parse_work_factor(stanza.arguments[1]);
    require_stanza(work_factor.has_value(), stanza, "has a work factor that is no plain number");
    require_stanza(*work_factor <= maximum_work_factor_, stanza,
                   "asks for more work than the 2^" + std::to_string(maximum_work_factor_) +
                       " allowed here; seal it anew with `age -p`, which asks for 2^18");
    require_stanza(stanza.body.size() == kWrappedFileKeySize, stanza, "has a body that is not 32 bytes long");
    return unwrap_file_key(wrap_key(passphrase_, *salt, *work_factor), stanza.body);
  }

  Secret passphrase_;
  int maximum_work_factor_;
};

}  // namespace

std::shared_ptr<const AgeRecipient> passphrase_recipient(const Secret& passphrase, int work_factor) {
  return std::make_shared<PassphraseRecipient>(passphrase, work_factor);
}

std::shared_ptr<const AgeIdentity> passphrase_identity(const Secret& passphrase, int maximum_work_factor) {
  return std::make_shared<PassphraseIdentity>(passphrase, maximum_work_factor);
}

}  // namespace kiroku::crypto
