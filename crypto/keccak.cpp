#include "crypto/keccak.h"

#include "base/error.h"
#include "crypto/openssl_handles.h"

namespace kiroku::crypto {
namespace {

const EVP_MD* fetched(Keccak function) {
  static const FetchedDigest sha3_256(EVP_MD_fetch(nullptr, "SHA3-256", nullptr));
  static const FetchedDigest sha3_512(EVP_MD_fetch(nullptr, "SHA3-512", nullptr));
  static const FetchedDigest shake128(EVP_MD_fetch(nullptr, "SHAKE-128", nullptr));
  static const FetchedDigest shake256(EVP_MD_fetch(nullptr, "SHAKE-256", nullptr));
  switch (function) {
    case Keccak::kSha3With256Bits:
      return sha3_256.get();
    case Keccak::kSha3With512Bits:
      return sha3_512.get();
    case Keccak::kShake128:
      return shake128.get();
    case Keccak::kShake256:
      return shake256.get();
  }
  return nullptr;
}

}  // namespace

void keccak(Keccak function, std::initializer_list<ByteView> parts, std::span<std::byte> out) {
  const bool extendable = function == Keccak::kShake128 || function == Keccak::kShake256;
  const DigestContext context(EVP_MD_CTX_new());
  bool done = context && EVP_DigestInit_ex2(context.get(), fetched(function), nullptr) == 1;
  for (const ByteView part : parts)
    done = done && EVP_DigestUpdate(context.get(), part.data(), part.size()) == 1;
  if (extendable) {
    done = done && EVP_DigestFinalXOF(context.get(), openssl_bytes(out), out.size()) == 1;
  } else {
    const std::size_t size = function == Keccak::kSha3With256Bits ? 32 : 64;
    done = done && out.size() == size && EVP_DigestFinal_ex(context.get(), openssl_bytes(out), nullptr) == 1;
  }
  if (!done) throw Error("cannot hash with Keccak: OpenSSL reports " + last_openssl_error());
}

}  // namespace kiroku::crypto
