#include "crypto/ml_kem_openssl.h"

#include <array>
#include <span>

#include <openssl/core_names.h>
#include <openssl/err.h>
#include <openssl/params.h>

#include "base/error.h"
#include "crypto/openssl_handles.h"

namespace kiroku::crypto {
namespace {

constexpr const char* kName = "ML-KEM-768";
// OSSL_PKEY_PARAM_ML_KEM_SEED and OSSL_KEM_PARAM_IKME, which OpenSSL 3.0 does not define.
constexpr const char* kSeed = "seed";
constexpr const char* kMessage = "ikme";

[[noreturn]] void fail(const std::string& action) {
  throw Error("cannot " + action + ": OpenSSL reports " + last_openssl_error());
}

/// One octet string and the end. OpenSSL's type is not const; it does not write there.
std::array<OSSL_PARAM, 2> parameter(const char* name, ByteView value) {
  return {OSSL_PARAM_construct_octet_string(name, const_cast<std::byte*>(value.data()), value.size()),
          OSSL_PARAM_construct_end()};
}

PrivateKey key_of(ByteView seed) {
  const PrivateKeyContext context(EVP_PKEY_CTX_new_from_name(nullptr, kName, nullptr));
  auto parameters = parameter(kSeed, seed);
  EVP_PKEY* key = nullptr;
  if (!context || EVP_PKEY_fromdata_init(context.get()) != 1 ||
      EVP_PKEY_fromdata(context.get(), &key, EVP_PKEY_KEYPAIR, parameters.data()) != 1)
    fail("make an ML-KEM-768 key");
  return PrivateKey(key);
}

}  // namespace

bool ml_kem_openssl::is_available() {
  static const bool available = [] {
    ERR_set_mark();
    const FetchedKem kem(EVP_KEM_fetch(nullptr, kName, nullptr));
    ERR_pop_to_mark();
    return kem != nullptr;
  }();
  return available;
}

Bytes ml_kem_openssl::public_key_of(ByteView seed) {
  const PrivateKey key = key_of(seed);
  Bytes result(kMlKemPublicKeySize);
  std::size_t size = result.size();
  if (EVP_PKEY_get_raw_public_key(key.get(), openssl_bytes(std::span<std::byte>(result)), &size) != 1 ||
      size != result.size())
    fail("derive an ML-KEM-768 public key");
  return result;
}

Secret ml_kem_openssl::decapsulate(ByteView seed, ByteView ciphertext) {
  const PrivateKey key = key_of(seed);
  const PrivateKeyContext context(EVP_PKEY_CTX_new_from_pkey(nullptr, key.get(), nullptr));
  Secret shared(kMlKemSharedSize);
  std::size_t size = shared.size();
  if (!context || EVP_PKEY_decapsulate_init(context.get(), nullptr) != 1 ||
      EVP_PKEY_decapsulate(context.get(), openssl_bytes(shared.bytes()), &size, openssl_bytes(ciphertext),
                           ciphertext.size()) != 1 ||
      size != shared.size())
    fail("open an ML-KEM-768 ciphertext");
  return shared;
}

MlKemEncapsulation ml_kem_openssl::encapsulate(ByteView public_key, ByteView message) {
  const PrivateKey key(
      EVP_PKEY_new_raw_public_key_ex(nullptr, kName, nullptr, openssl_bytes(public_key), public_key.size()));
  const PrivateKeyContext context(key ? EVP_PKEY_CTX_new_from_pkey(nullptr, key.get(), nullptr) : nullptr);
  const auto parameters = parameter(kMessage, message);
  MlKemEncapsulation result{Bytes(kMlKemCiphertextSize), Secret(kMlKemSharedSize)};
  std::size_t ciphertext_size = result.ciphertext.size();
  std::size_t shared_size = result.shared_secret.size();
  if (!context || EVP_PKEY_encapsulate_init(context.get(), parameters.data()) != 1 ||
      EVP_PKEY_encapsulate(context.get(), openssl_bytes(std::span<std::byte>(result.ciphertext)),
                           &ciphertext_size, openssl_bytes(result.shared_secret.bytes()),
                           &shared_size) != 1 ||
      ciphertext_size != result.ciphertext.size() || shared_size != result.shared_secret.size())
    fail("seal with an ML-KEM-768 key");
  return result;
}

}  // namespace kiroku::crypto
