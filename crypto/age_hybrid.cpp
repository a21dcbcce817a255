#include "crypto/age_hybrid.h"

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/file_key_wrap.h"
#include "crypto/hpke.h"
#include "crypto/x_wing.h"

namespace kiroku::crypto {
namespace {

constexpr std::string_view kStanzaType = "mlkem768x25519";
constexpr std::string_view kRecipientPart = "age1pq";
constexpr std::string_view kIdentityPart = "AGE-SECRET-KEY-PQ-";
constexpr std::string_view kInfo = "age-encryption.org/mlkem768x25519";
constexpr std::uint16_t kXWingKem = 0x647a;

class HybridRecipient : public AgeRecipient {
 public:
  explicit HybridRecipient(Bytes key) : key_(std::move(key)) {}
  [[nodiscard]] AgeStanza wrap(const Secret& file_key) const override {
    const auto encapsulation = x_wing_encapsulate(key_, Secret::random(kMlKemMessageSize + kX25519KeySize));
    const HpkeKeys keys = hpke_base_keys(kXWingKem, encapsulation.shared_secret, kInfo);
    Bytes body(kWrappedFileKeySize);
    ChaCha20Poly1305(keys.key.bytes()).seal(keys.nonce.bytes(), file_key.bytes(), body);
    return {std::string(kStanzaType), {to_base64(encapsulation.ciphertext, Base64Padding::kUnpadded)}, body};
  }
  [[nodiscard]] bool is_post_quantum() const override { return true; }
  [[nodiscard]] std::string to_string() const override { return to_bech32(kRecipientPart, key_); }

 private:
  Bytes key_;
};

class HybridIdentity : public AgeIdentity {
 public:
  explicit HybridIdentity(const Secret& seed) : key_(seed.bytes()) {}
  [[nodiscard]] std::optional<Secret> unwrap(const std::vector<AgeStanza>& stanzas) const override {
    for (const auto& stanza : stanzas) {
      if (stanza.type != kStanzaType) continue;
      if (auto file_key = unwrap(stanza)) return file_key;
    }
    return std::nullopt;
  }
  [[nodiscard]] std::string recipient() const override {
    return to_bech32(kRecipientPart, key_.public_key());
  }

 private:
  [[nodiscard]] std::optional<Secret> unwrap(const AgeStanza& stanza) const {
    require_stanza(stanza.arguments.size() == 1, stanza, "has not one argument");
    const auto ciphertext = from_base64(stanza.arguments[0], Base64Padding::kUnpadded);
    require_stanza(ciphertext && ciphertext->size() == kXWingCiphertextSize, stanza,
                   "has an encapsulated key that is not 1120 bytes of canonical base64");
    require_stanza(stanza.body.size() == kWrappedFileKeySize, stanza, "has a body that is not 32 bytes long");
    const auto shared_secret = key_.decapsulate(*ciphertext);
    require_stanza(shared_secret.has_value(), stanza, "has a share of low order");
    const HpkeKeys keys = hpke_base_keys(kXWingKem, *shared_secret, kInfo);
    Secret file_key(kFileKeySize);
    if (!ChaCha20Poly1305(keys.key.bytes()).open(keys.nonce.bytes(), stanza.body, file_key.bytes()))
      return std::nullopt;
    return file_key;
  }

  XWingPrivateKey key_;
};

Secret seed_of(std::string_view identity_text) {
  auto decoded = from_bech32(identity_text);
  const bool right =
      decoded && decoded->human_part == kIdentityPart && decoded->bytes.size() == kXWingSeedSize;
  Secret seed = right ? Secret::copy_of(decoded->bytes) : Secret();
  if (decoded) zeroise(decoded->bytes);
  if (!right)
    throw UsageError(
        "this is no age identity: it must be the line \"AGE-SECRET-KEY-PQ-1...\" that age-keygen -pq "
        "wrote, unchanged");
  return seed;
}

}  // namespace

bool is_hybrid_recipient_text(std::string_view text) { return text.starts_with("age1pq1"); }
bool is_hybrid_identity_text(std::string_view text) { return text.starts_with("AGE-SECRET-KEY-PQ-1"); }

std::shared_ptr<const AgeRecipient> parse_hybrid_recipient(std::string_view text) {
  auto decoded = from_bech32(text);
  if (!decoded || decoded->human_part != kRecipientPart || !is_x_wing_public_key(decoded->bytes))
    throw UsageError(
        "\"" + std::string(text) +
        "\" is no post-quantum age recipient: it must be \"age1pq1...\" as age-keygen -pq prints it, "
        "unchanged");
  return std::make_shared<HybridRecipient>(std::move(decoded->bytes));
}

std::shared_ptr<const AgeIdentity> parse_hybrid_identity(std::string_view text) {
  return std::make_shared<HybridIdentity>(seed_of(text));
}

AgeKeyPair generate_hybrid_age_key() {
  const Secret seed = Secret::random(kXWingSeedSize);
  std::string text = to_bech32(kIdentityPart, seed.bytes());
  AgeKeyPair pair{Secret::copy_of(text),
                  to_bech32(kRecipientPart, XWingPrivateKey(seed.bytes()).public_key())};
  zeroise(std::as_writable_bytes(std::span(text)));
  return pair;
}

std::string hybrid_recipient_of(std::string_view identity_text) {
  return to_bech32(kRecipientPart, XWingPrivateKey(seed_of(identity_text).bytes()).public_key());
}

}  // namespace kiroku::crypto
