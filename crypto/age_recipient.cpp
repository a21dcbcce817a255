#include "crypto/age_recipient.h"

#include <algorithm>

#include "base/error.h"
#include "crypto/age_hybrid.h"
#include "crypto/encoding.h"
#include "crypto/file_key_wrap.h"
#include "crypto/key_derivation.h"
#include "crypto/x25519.h"

namespace kiroku::crypto {
namespace {

constexpr std::string_view kStanzaType = "X25519";
constexpr std::string_view kRecipientPart = "age";
constexpr std::string_view kIdentityPart = "AGE-SECRET-KEY-";
constexpr std::string_view kWrapInfo = "age-encryption.org/v1/X25519";

Secret wrap_key(const Secret& shared_secret, const X25519PublicKey& share, const X25519PublicKey& recipient) {
  Bytes salt = to_bytes(share);
  append(salt, recipient);
  return hkdf_sha256(shared_secret.bytes(), salt, kWrapInfo);
}

class X25519Recipient : public AgeRecipient {
 public:
  explicit X25519Recipient(const X25519PublicKey& key) : key_(key) {}

  [[nodiscard]] AgeStanza wrap(const Secret& file_key) const override {
    const Secret ephemeral = Secret::random(kX25519KeySize);
    const X25519PublicKey share = x25519_public_key(ephemeral.bytes());
    const auto shared_secret = x25519(ephemeral.bytes(), key_);
    if (!shared_secret)
      throw UsageError("the recipient " + to_string() +
                       " is a point of low order that anybody could read; "
                       "get a key made by age-keygen");
    return {std::string(kStanzaType),
            {to_base64(share, Base64Padding::kUnpadded)},
            wrap_file_key(wrap_key(*shared_secret, share, key_), file_key)};
  }
  [[nodiscard]] std::string to_string() const override { return to_bech32(kRecipientPart, key_); }

 private:
  X25519PublicKey key_;
};

class X25519Identity : public AgeIdentity {
 public:
  explicit X25519Identity(Secret key) : key_(std::move(key)), public_key_(x25519_public_key(key_.bytes())) {}

  [[nodiscard]] std::optional<Secret> unwrap(const std::vector<AgeStanza>& stanzas) const override {
    for (const auto& stanza : stanzas) {
      if (stanza.type != kStanzaType) continue;
      if (auto file_key = unwrap(stanza)) return file_key;
    }
    return std::nullopt;
  }
  [[nodiscard]] std::string recipient() const override { return to_bech32(kRecipientPart, public_key_); }

 private:
  [[nodiscard]] std::optional<Secret> unwrap(const AgeStanza& stanza) const {
    require_stanza(stanza.arguments.size() == 1, stanza, "has not one argument");
    const auto share_bytes = from_base64(stanza.arguments[0], Base64Padding::kUnpadded);
    X25519PublicKey share;
    require_stanza(share_bytes && share_bytes->size() == share.size(), stanza,
                   "has a share that is not 32 bytes of canonical base64");
    std::ranges::copy(*share_bytes, share.begin());
    require_stanza(stanza.body.size() == kWrappedFileKeySize, stanza, "has a body that is not 32 bytes long");
    const auto shared_secret = x25519(key_.bytes(), share);
    require_stanza(shared_secret.has_value(), stanza, "has a share of low order");
    return unwrap_file_key(wrap_key(*shared_secret, share, public_key_), stanza.body);
  }

  Secret key_;
  X25519PublicKey public_key_;
};

// The 32 bytes of an identity text; throws without repeating the secret text.
Secret secret_key_of(std::string_view text) {
  auto decoded = from_bech32(text);
  if (!decoded || decoded->human_part != kIdentityPart || decoded->bytes.size() != kX25519KeySize) {
    if (decoded) zeroise(decoded->bytes);
    throw UsageError(
        "this is no age identity: it must be the line \"AGE-SECRET-KEY-1...\" that age-keygen wrote, "
        "unchanged");
  }
  Secret key = Secret::copy_of(decoded->bytes);
  zeroise(decoded->bytes);
  return key;
}

}  // namespace

std::shared_ptr<const AgeRecipient> parse_recipient(std::string_view text) {
  if (is_hybrid_recipient_text(text)) return parse_hybrid_recipient(text);
  const auto decoded = from_bech32(text);
  X25519PublicKey key;
  if (!decoded || decoded->human_part != kRecipientPart || decoded->bytes.size() != key.size())
    throw UsageError("\"" + std::string(text) +
                     "\" is no age recipient: it must be \"age1...\" as age-keygen prints it, unchanged");
  std::ranges::copy(decoded->bytes, key.begin());
  return std::make_shared<X25519Recipient>(key);
}

AgeRecipients parse_recipients(std::string_view text, const std::string& name_for_errors) {
  AgeRecipients recipients;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (line.empty() || line.starts_with('#')) continue;
    try {
      recipients.push_back(parse_recipient(line));
    } catch (const UsageError& error) {
      throw UsageError(name_for_errors + ", line " + std::to_string(number) + ": " + error.what());
    }
  }
  if (recipients.empty())
    throw UsageError(name_for_errors + " names no recipient; write one \"age1...\" a line into it");
  return recipients;
}

AgeKeyPair generate_age_key() {
  const Secret key = Secret::random(kX25519KeySize);
  std::string text = to_bech32(kIdentityPart, key.bytes());
  AgeKeyPair pair{Secret::copy_of(text), to_bech32(kRecipientPart, x25519_public_key(key.bytes()))};
  zeroise(std::as_writable_bytes(std::span(text)));
  return pair;
}

std::string recipient_of(std::string_view identity_text) {
  if (is_hybrid_identity_text(identity_text)) return hybrid_recipient_of(identity_text);
  return to_bech32(kRecipientPart, x25519_public_key(secret_key_of(identity_text).bytes()));
}

std::shared_ptr<const AgeIdentity> parse_identity(std::string_view text) {
  if (is_hybrid_identity_text(text)) return parse_hybrid_identity(text);
  return std::make_shared<X25519Identity>(secret_key_of(text));
}

}  // namespace kiroku::crypto
