#include "crypto/hpke.h"

#include "crypto/aead.h"
#include "crypto/key_derivation.h"

namespace kiroku::crypto {
namespace {

constexpr std::uint16_t kHkdfSha256 = 0x0001;
constexpr std::uint16_t kChaCha20Poly1305 = 0x0003;
constexpr std::byte kBaseMode{0x00};

void append_number(Bytes& to, std::size_t number) {
  to.push_back(static_cast<std::byte>(number >> 8 & 0xff));
  to.push_back(static_cast<std::byte>(number & 0xff));
}

Bytes suite_of(std::uint16_t kem) {
  Bytes suite = to_bytes("HPKE");
  for (const std::uint16_t number : {kem, kHkdfSha256, kChaCha20Poly1305}) append_number(suite, number);
  return suite;
}

// HKDF-Extract is one HMAC under the salt.
Sha256Digest labeled_extract(ByteView suite, ByteView salt, std::string_view label, ByteView input_key) {
  Bytes message = to_bytes("HPKE-v1");
  append(message, suite);
  append(message, bytes_of(label));
  append(message, input_key);
  const Sha256Digest result = hmac_sha256(salt, message);
  zeroise(message);
  return result;
}

// HKDF-Expand to at most 32 bytes is one HMAC, over its info and a counter of 1.
Secret labeled_expand(ByteView suite, ByteView pseudorandom_key, std::string_view label, ByteView info,
                      std::size_t size) {
  Bytes message;
  append_number(message, size);
  append(message, bytes_of("HPKE-v1"));
  append(message, suite);
  append(message, bytes_of(label));
  append(message, info);
  message.push_back(std::byte{1});
  Sha256Digest block = hmac_sha256(pseudorandom_key, message);
  Secret result = Secret::copy_of(ByteView(block).first(size));
  zeroise(block);
  return result;
}

}  // namespace

HpkeKeys hpke_base_keys(std::uint16_t kem, const Secret& shared_secret, std::string_view info) {
  const Bytes suite = suite_of(kem);
  Bytes context = {kBaseMode};
  append(context, labeled_extract(suite, {}, "psk_id_hash", {}));
  append(context, labeled_extract(suite, {}, "info_hash", bytes_of(info)));
  Sha256Digest secret = labeled_extract(suite, shared_secret.bytes(), "secret", {});
  HpkeKeys keys{labeled_expand(suite, secret, "key", context, kAeadKeySize),
                labeled_expand(suite, secret, "base_nonce", context, kAeadNonceSize)};
  zeroise(secret);
  return keys;
}

}  // namespace kiroku::crypto
