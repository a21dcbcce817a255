#include "crypto/key_derivation.h"

#include <array>

#include <openssl/core_names.h>
#include <openssl/hmac.h>
#include <openssl/params.h>

#include "base/error.h"
#include "crypto/openssl_handles.h"

namespace kiroku::crypto {
namespace {

constexpr std::size_t kDerivedSize = 32;

[[noreturn]] void fail(const char* what) {
  throw Error(std::string("cannot ") + what + ": OpenSSL reports " + last_openssl_error());
}

// OSSL_PARAM takes pointers that are not const, but only reads them when setting.
OSSL_PARAM octets(const char* name, ByteView bytes) {
  return OSSL_PARAM_construct_octet_string(name, const_cast<std::byte*>(bytes.data()), bytes.size());
}

}  // namespace

Secret hkdf_sha256(ByteView input_key, ByteView salt, std::string_view info) {
  static const FetchedKdf hkdf(EVP_KDF_fetch(nullptr, "HKDF", nullptr));
  const KdfContext context(EVP_KDF_CTX_new(hkdf.get()));
  std::array<char, 9> digest_name{"SHA2-256"};
  std::array<OSSL_PARAM, 5> parameters = {
      OSSL_PARAM_construct_utf8_string(OSSL_KDF_PARAM_DIGEST, digest_name.data(), 0),
      octets(OSSL_KDF_PARAM_KEY, input_key), octets(OSSL_KDF_PARAM_INFO, bytes_of(info)),
      // An absent salt means a block of zeros, which is also what an empty one means.
      salt.empty() ? OSSL_PARAM_construct_end() : octets(OSSL_KDF_PARAM_SALT, salt),
      OSSL_PARAM_construct_end()};
  Secret result(kDerivedSize);
  if (!context ||
      EVP_KDF_derive(context.get(), openssl_bytes(result.bytes()), result.size(), parameters.data()) != 1)
    fail("derive a key");
  return result;
}

Sha256Digest hmac_sha256(ByteView key, ByteView message) {
  Sha256Digest result;
  if (HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()), openssl_bytes(message), message.size(),
           openssl_bytes(std::span<std::byte>(result)), nullptr) == nullptr)
    fail("compute an HMAC");
  return result;
}

Secret scrypt(ByteView passphrase, ByteView salt, int log2_n) {
  constexpr std::uint64_t kR = 8;
  constexpr std::uint64_t kP = 1;
  if (log2_n < 1 || log2_n > 40) throw UsageError("scrypt's work factor must be from 1 to 40");
  const std::uint64_t n = std::uint64_t{1} << log2_n;
  const std::uint64_t memory_limit =
      128 * kR * (n + 16);  // N blocks, and a few that OpenSSL needs beside them
  Secret result(kDerivedSize);
  if (EVP_PBE_scrypt(text_of(passphrase).data(), passphrase.size(), openssl_bytes(salt), salt.size(), n, kR,
                     kP, memory_limit, openssl_bytes(result.bytes()), result.size()) != 1)
    fail("derive a key from a passphrase");
  return result;
}

}  // namespace kiroku::crypto
