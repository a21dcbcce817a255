#include "crypto/pkcs8.h"

#include <algorithm>
#include <array>
#include <limits>
#include <span>
#include <string>

#include <openssl/asn1.h>
#include <openssl/objects.h>
#include <openssl/pem.h>
#include <openssl/pkcs12.h>

#include "base/error.h"

namespace kiroku::crypto {
namespace {

using EncryptedKey = std::unique_ptr<X509_SIG, OpenSslDeleter<X509_SIG_free>>;
using ObjectIdentifier = std::unique_ptr<ASN1_OBJECT, OpenSslDeleter<ASN1_OBJECT_free>>;

// OWASP's figure for PBKDF2-HMAC-SHA-256; OpenSSL's own default of 2048 is from another age.
constexpr int kPassphraseIterations = 600'000;
// RFC 9881: the private key is the seed [0] IMPLICIT OCTET STRING (SIZE (32)).
constexpr std::array<std::byte, 2> kSeedHeader = {std::byte{0x80}, std::byte{kMlDsaSeedSize}};

[[noreturn]] void fail(const std::string& what) {
  throw Error("cannot " + what + ": OpenSSL reports " + last_openssl_error());
}

/// id-ml-dsa-44 and id-ml-dsa-65, which OpenSSL 3.0 has no names for.
ObjectIdentifier identifier_of(MlDsaSet set) {
  ObjectIdentifier identifier(
      OBJ_txt2obj(set == MlDsaSet::k44 ? "2.16.840.1.101.3.4.3.17" : "2.16.840.1.101.3.4.3.18", 1));
  if (!identifier) fail("name the algorithm of a key");
  return identifier;
}

KeyInfo read_key_info(std::string_view pem, const Secret* passphrase) {
  if (pem.size() > static_cast<std::size_t>(std::numeric_limits<int>::max())) return nullptr;
  const BufferIo io(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())));
  if (!io) return nullptr;
  if (passphrase == nullptr)
    return KeyInfo(PEM_read_bio_PKCS8_PRIV_KEY_INFO(io.get(), nullptr, nullptr, nullptr));
  const EncryptedKey encrypted(PEM_read_bio_PKCS8(io.get(), nullptr, nullptr, nullptr));
  if (!encrypted || passphrase->size() > PEM_BUFSIZE) return nullptr;
  return KeyInfo(
      PKCS8_decrypt(encrypted.get(), passphrase->text().data(), static_cast<int>(passphrase->size())));
}

}  // namespace

Secret pkcs8_pem(const PKCS8_PRIV_KEY_INFO& key, const Secret* passphrase) {
  const BufferIo io(BIO_new(BIO_s_secmem()));
  if (!io) fail("write the signing key");
  // OpenSSL changes nothing in it.
  auto* const plain = const_cast<PKCS8_PRIV_KEY_INFO*>(&key);
  if (passphrase == nullptr) {
    if (PEM_write_bio_PKCS8_PRIV_KEY_INFO(io.get(), plain) != 1) fail("write the signing key");
  } else {
    if (passphrase->size() > PEM_BUFSIZE)
      throw UsageError("the passphrase for the signing key is longer than 1024 bytes; choose a shorter one");
    const EncryptedKey encrypted(PKCS8_encrypt(-1, EVP_aes_256_cbc(), passphrase->text().data(),
                                               static_cast<int>(passphrase->size()), nullptr, 0,
                                               kPassphraseIterations, plain));
    if (!encrypted || PEM_write_bio_PKCS8(io.get(), encrypted.get()) != 1) fail("encrypt the signing key");
  }
  const char* text = nullptr;
  const long size = BIO_get_mem_data(io.get(), &text);
  if (size <= 0) fail("write the signing key");
  return Secret::copy_of(std::string_view(text, static_cast<std::size_t>(size)));
}

Secret ml_dsa_pem(const MlDsaPrivateKey& key, const Secret* passphrase) {
  const KeyInfo info(PKCS8_PRIV_KEY_INFO_new());
  constexpr std::size_t kSize = kSeedHeader.size() + kMlDsaSeedSize;
  auto* const bytes = static_cast<std::byte*>(OPENSSL_malloc(kSize));
  if (!info || bytes == nullptr) fail("write an ML-DSA key");
  std::ranges::copy(kSeedHeader, bytes);
  std::ranges::copy(key.seed().bytes(), bytes + kSeedHeader.size());
  // Both belong to `info` afterwards, which clears the key when it goes.
  if (PKCS8_pkey_set0(info.get(), identifier_of(key.set()).release(), 0, V_ASN1_UNDEF, nullptr,
                      openssl_bytes(std::span(bytes, kSize)), static_cast<int>(kSize)) != 1)
    fail("write an ML-DSA key");
  return pkcs8_pem(*info, passphrase);
}

std::optional<MlDsaPrivateKey> ml_dsa_of_pem(MlDsaSet set, std::string_view pem, const Secret* passphrase) {
  const KeyInfo info = read_key_info(pem, passphrase);
  const ASN1_OBJECT* algorithm = nullptr;
  const unsigned char* key = nullptr;
  int size = 0;
  if (!info || PKCS8_pkey_get0(&algorithm, &key, &size, nullptr, info.get()) != 1) {
    last_openssl_error();  // what it is instead is for the reader of other keys to say
    return std::nullopt;
  }
  if (OBJ_cmp(algorithm, identifier_of(set).get()) != 0) return std::nullopt;
  const ByteView bytes = std::as_bytes(std::span(key, static_cast<std::size_t>(size)));
  if (bytes.size() != kSeedHeader.size() + kMlDsaSeedSize ||
      !std::ranges::equal(bytes.first(kSeedHeader.size()), kSeedHeader))
    throw Error(std::string("the ") + ml_dsa_name(set) +
                " key is not kept as its seed alone (RFC 9881); give it in that form");
  return MlDsaPrivateKey(set, bytes.subspan(kSeedHeader.size()));
}

}  // namespace kiroku::crypto
