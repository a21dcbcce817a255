#include "crypto/ml_dsa_openssl.h"

#include <array>
#include <span>
#include <string>

#include <openssl/core_names.h>
#include <openssl/err.h>
#include <openssl/params.h>

#include "base/error.h"
#include "crypto/openssl_handles.h"

namespace kiroku::crypto {
namespace {

using FetchedSignature = std::unique_ptr<EVP_SIGNATURE, OpenSslDeleter<EVP_SIGNATURE_free>>;

// OSSL_PKEY_PARAM_ML_DSA_SEED, OSSL_SIGNATURE_PARAM_CONTEXT_STRING and OSSL_SIGNATURE_PARAM_TEST_ENTROPY,
// which OpenSSL 3.0 does not define. The last one is rnd of FIPS 204, instead of bytes that OpenSSL draws.
constexpr const char* kSeed = "seed";
constexpr const char* kContext = "context-string";
constexpr const char* kRandomness = "test-entropy";

[[noreturn]] void fail(const std::string& action) {
  throw Error("cannot " + action + ": OpenSSL reports " + last_openssl_error());
}

/// OpenSSL's type is not const; it does not write there.
OSSL_PARAM parameter(const char* name, ByteView value) {
  return OSSL_PARAM_construct_octet_string(name, const_cast<std::byte*>(value.data()), value.size());
}

PrivateKey key_of(MlDsaSet set, ByteView seed) {
  const PrivateKeyContext context(EVP_PKEY_CTX_new_from_name(nullptr, ml_dsa_name(set), nullptr));
  std::array parameters = {parameter(kSeed, seed), OSSL_PARAM_construct_end()};
  EVP_PKEY* key = nullptr;
  if (!context || EVP_PKEY_fromdata_init(context.get()) != 1 ||
      EVP_PKEY_fromdata(context.get(), &key, EVP_PKEY_KEYPAIR, parameters.data()) != 1)
    fail(std::string("make an ") + ml_dsa_name(set) + " key");
  return PrivateKey(key);
}

}  // namespace

bool ml_dsa_openssl::is_available() {
  static const bool available = [] {
    ERR_set_mark();
    const FetchedSignature first(EVP_SIGNATURE_fetch(nullptr, ml_dsa_name(MlDsaSet::k44), nullptr));
    const FetchedSignature second(EVP_SIGNATURE_fetch(nullptr, ml_dsa_name(MlDsaSet::k65), nullptr));
    ERR_pop_to_mark();
    return first && second;
  }();
  return available;
}

Bytes ml_dsa_openssl::public_key_of(MlDsaSet set, ByteView seed) {
  const PrivateKey key = key_of(set, seed);
  Bytes result(ml_dsa_public_key_size(set));
  std::size_t size = result.size();
  if (EVP_PKEY_get_raw_public_key(key.get(), openssl_bytes(std::span<std::byte>(result)), &size) != 1 ||
      size != result.size())
    fail(std::string("derive an ") + ml_dsa_name(set) + " public key");
  return result;
}

Bytes ml_dsa_openssl::sign(MlDsaSet set, ByteView seed, ByteView randomness, ByteView message,
                           ByteView context) {
  const PrivateKey key = key_of(set, seed);
  const DigestContext signing(EVP_MD_CTX_new());
  const std::array parameters = {parameter(kContext, context), parameter(kRandomness, randomness),
                                 OSSL_PARAM_construct_end()};
  Bytes result(ml_dsa_signature_size(set));
  std::size_t size = result.size();
  if (!signing ||
      EVP_DigestSignInit_ex(signing.get(), nullptr, nullptr, nullptr, nullptr, key.get(),
                            parameters.data()) != 1 ||
      EVP_DigestSign(signing.get(), openssl_bytes(std::span<std::byte>(result)), &size,
                     openssl_bytes(message), message.size()) != 1 ||
      size != result.size())
    fail(std::string("sign with ") + ml_dsa_name(set));
  return result;
}

bool ml_dsa_openssl::verify(MlDsaSet set, ByteView public_key, ByteView message, ByteView signature,
                            ByteView context) {
  const PrivateKey key(EVP_PKEY_new_raw_public_key_ex(nullptr, ml_dsa_name(set), nullptr,
                                                      openssl_bytes(public_key), public_key.size()));
  const DigestContext checking(EVP_MD_CTX_new());
  const std::array parameters = {parameter(kContext, context), OSSL_PARAM_construct_end()};
  if (!key || !checking ||
      EVP_DigestVerifyInit_ex(checking.get(), nullptr, nullptr, nullptr, nullptr, key.get(),
                              parameters.data()) != 1)
    fail(std::string("check a signature of ") + ml_dsa_name(set));
  const bool valid = EVP_DigestVerify(checking.get(), openssl_bytes(signature), signature.size(),
                                      openssl_bytes(message), message.size()) == 1;
  if (!valid)
    last_openssl_error();  // a refused signature is an answer, not an error for somebody else's queue
  return valid;
}

}  // namespace kiroku::crypto
