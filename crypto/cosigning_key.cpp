#include "crypto/cosigning_key.h"

#include <algorithm>
#include <array>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include <openssl/asn1.h>
#include <openssl/objects.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include "base/error.h"
#include "crypto/openssl_handles.h"

namespace kiroku::crypto {
namespace {

using KeyInfo = std::unique_ptr<PKCS8_PRIV_KEY_INFO, OpenSslDeleter<PKCS8_PRIV_KEY_INFO_free>>;
using ObjectIdentifier = std::unique_ptr<ASN1_OBJECT, OpenSslDeleter<ASN1_OBJECT_free>>;

// id-ml-dsa-44, which OpenSSL 3.0 has no name for.
constexpr const char* kMlDsa44 = "2.16.840.1.101.3.4.3.17";
// RFC 9881: the private key is ML-DSA-44-PrivateKey's seed [0] IMPLICIT OCTET STRING (SIZE (32)).
constexpr std::array<std::byte, 2> kSeedHeader = {std::byte{0x80}, std::byte{kMlDsaSeedSize}};

[[noreturn]] void fail() {
  throw Error("cannot write the witness's key: OpenSSL reports " + last_openssl_error());
}

ObjectIdentifier ml_dsa_44() {
  ObjectIdentifier identifier(OBJ_txt2obj(kMlDsa44, 1));
  if (!identifier) fail();
  return identifier;
}

/// Nothing where the PEM is of another algorithm or none.
std::optional<MlDsaPrivateKey> ml_dsa_key_of(std::string_view pem) {
  if (pem.size() > static_cast<std::size_t>(std::numeric_limits<int>::max())) return std::nullopt;
  const BufferIo io(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())));
  const KeyInfo info(io ? PEM_read_bio_PKCS8_PRIV_KEY_INFO(io.get(), nullptr, nullptr, nullptr) : nullptr);
  const ASN1_OBJECT* algorithm = nullptr;
  const unsigned char* key = nullptr;
  int size = 0;
  if (!info || PKCS8_pkey_get0(&algorithm, &key, &size, nullptr, info.get()) != 1) {
    last_openssl_error();  // what it is instead is for the reader of other keys to say
    return std::nullopt;
  }
  if (OBJ_cmp(algorithm, ml_dsa_44().get()) != 0) return std::nullopt;
  const ByteView bytes = std::as_bytes(std::span(key, static_cast<std::size_t>(size)));
  if (bytes.size() != kSeedHeader.size() + kMlDsaSeedSize ||
      !std::ranges::equal(bytes.first(kSeedHeader.size()), kSeedHeader))
    throw Error("the ML-DSA-44 key is not kept as its seed alone (RFC 9881); give it in that form");
  return MlDsaPrivateKey(MlDsaSet::k44, bytes.subspan(kSeedHeader.size()));
}

Secret pem_of(const MlDsaPrivateKey& key) {
  const KeyInfo info(PKCS8_PRIV_KEY_INFO_new());
  const BufferIo io(BIO_new(BIO_s_secmem()));
  constexpr std::size_t kSize = kSeedHeader.size() + kMlDsaSeedSize;
  auto* const bytes = static_cast<std::byte*>(OPENSSL_malloc(kSize));
  if (!info || !io || bytes == nullptr) fail();
  std::ranges::copy(kSeedHeader, bytes);
  std::ranges::copy(key.seed().bytes(), bytes + kSeedHeader.size());
  // Both belong to `info` afterwards, which clears the key when it goes.
  if (PKCS8_pkey_set0(info.get(), ml_dsa_44().release(), 0, V_ASN1_UNDEF, nullptr,
                      openssl_bytes(std::span(bytes, kSize)), static_cast<int>(kSize)) != 1 ||
      PEM_write_bio_PKCS8_PRIV_KEY_INFO(io.get(), info.get()) != 1)
    fail();
  const char* text = nullptr;
  const long size = BIO_get_mem_data(io.get(), &text);
  if (size <= 0) fail();
  return Secret::copy_of(std::string_view(text, static_cast<std::size_t>(size)));
}

}  // namespace

CosigningKey::CosigningKey(SigningKey key) : key_(std::move(key)) {}

CosigningKey::CosigningKey(MlDsaPrivateKey key) : key_(std::move(key)) {
  if (std::get<MlDsaPrivateKey>(key_).set() != MlDsaSet::k44)
    throw UsageError("a witness signs by Ed25519 or ML-DSA-44 alone");
}

CosigningKey CosigningKey::generate(CosignatureAlgorithm algorithm) {
  if (algorithm == CosignatureAlgorithm::kEd25519) return CosigningKey(SigningKey::generate());
  return CosigningKey(MlDsaPrivateKey::generate(MlDsaSet::k44));
}

CosigningKey CosigningKey::from_pem(std::string_view pem) {
  if (auto key = ml_dsa_key_of(pem)) return CosigningKey(std::move(*key));
  return CosigningKey(SigningKey::from_pem(pem, nullptr));
}

Secret CosigningKey::to_pem() const {
  if (const auto* key = std::get_if<SigningKey>(&key_)) return key->to_pem(nullptr);
  return pem_of(std::get<MlDsaPrivateKey>(key_));
}

CosignerKey CosigningKey::public_key(const std::string& name) const {
  if (const auto* key = std::get_if<SigningKey>(&key_)) return {name, key->public_key()};
  return CosignerKey::of_ml_dsa_44(name, std::get<MlDsaPrivateKey>(key_).public_key());
}

std::string CosigningKey::cosign(std::string_view text, const std::string& name, std::uint64_t time_s) const {
  return std::visit([&](const auto& key) { return crypto::cosign(text, name, key, time_s); }, key_);
}

}  // namespace kiroku::crypto
