#include "crypto/hash.h"

#include <algorithm>

#include "base/error.h"

namespace kiroku::crypto {
namespace {

// Fetched once: an implicit fetch at each hash would cost more than hashing a ledger line.
const EVP_MD* fetched(HashAlgorithm algorithm) {
  static const FetchedDigest sha256_digest(EVP_MD_fetch(nullptr, "SHA2-256", nullptr));
  static const FetchedDigest sha384_digest(EVP_MD_fetch(nullptr, "SHA2-384", nullptr));
  static const FetchedDigest sha512_digest(EVP_MD_fetch(nullptr, "SHA2-512", nullptr));
  static const FetchedDigest sha3_256_digest(EVP_MD_fetch(nullptr, "SHA3-256", nullptr));
  static const FetchedDigest sha3_384_digest(EVP_MD_fetch(nullptr, "SHA3-384", nullptr));
  static const FetchedDigest sha3_512_digest(EVP_MD_fetch(nullptr, "SHA3-512", nullptr));
  static const FetchedDigest sha224_digest(EVP_MD_fetch(nullptr, "SHA2-224", nullptr));
  switch (algorithm) {
    case HashAlgorithm::kSha224:
      return sha224_digest.get();
    case HashAlgorithm::kSha256:
      return sha256_digest.get();
    case HashAlgorithm::kSha384:
      return sha384_digest.get();
    case HashAlgorithm::kSha512:
      return sha512_digest.get();
    case HashAlgorithm::kSha3_256:
      return sha3_256_digest.get();
    case HashAlgorithm::kSha3_384:
      return sha3_384_digest.get();
    case HashAlgorithm::kSha3_512:
      return sha3_512_digest.get();
  }
  return nullptr;
}

[[noreturn]] void fail() { throw Error("cannot hash: OpenSSL reports " + last_openssl_error()); }

void start(EVP_MD_CTX* context, HashAlgorithm algorithm) {
  if (context == nullptr || EVP_DigestInit_ex2(context, fetched(algorithm), nullptr) != 1) fail();
}

void hash_once(HashAlgorithm algorithm, ByteView bytes, std::span<std::byte> out) {
  thread_local const DigestContext context(EVP_MD_CTX_new());
  start(context.get(), algorithm);
  if (EVP_DigestUpdate(context.get(), bytes.data(), bytes.size()) != 1 ||
      EVP_DigestFinal_ex(context.get(), openssl_bytes(out), nullptr) != 1)
    fail();
}

}  // namespace

Sha256::Sha256() : context_(EVP_MD_CTX_new()) { start(context_.get(), HashAlgorithm::kSha256); }

void Sha256::update(ByteView bytes) {
  if (EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size()) != 1) fail();
}

Sha256Digest Sha256::finish() {
  Sha256Digest result;
  if (EVP_DigestFinal_ex(context_.get(), openssl_bytes(std::span<std::byte>(result)), nullptr) != 1) fail();
  start(context_.get(), HashAlgorithm::kSha256);
  return result;
}

Sha256Digest sha256(ByteView bytes) {
  Sha256Digest result;
  hash_once(HashAlgorithm::kSha256, bytes, result);
  return result;
}

std::string_view hash_name(HashAlgorithm algorithm) {
  switch (algorithm) {
    case HashAlgorithm::kSha224:
      return "sha224";
    case HashAlgorithm::kSha256:
      return "sha256";
    case HashAlgorithm::kSha384:
      return "sha384";
    case HashAlgorithm::kSha512:
      return "sha512";
    case HashAlgorithm::kSha3_256:
      return "sha3-256";
    case HashAlgorithm::kSha3_384:
      return "sha3-384";
    case HashAlgorithm::kSha3_512:
      return "sha3-512";
  }
  return "";
}

std::optional<HashAlgorithm> hash_named(std::string_view name) {
  const auto* found = std::ranges::find(kHashAlgorithms, name, hash_name);
  if (found == kHashAlgorithms.end()) return {};
  return *found;
}

std::size_t hash_size(HashAlgorithm algorithm) {
  switch (algorithm) {
    case HashAlgorithm::kSha224:
      return 28;
    case HashAlgorithm::kSha256:
    case HashAlgorithm::kSha3_256:
      return 32;
    case HashAlgorithm::kSha384:
    case HashAlgorithm::kSha3_384:
      return 48;
    case HashAlgorithm::kSha512:
    case HashAlgorithm::kSha3_512:
      return 64;
  }
  return 0;
}

Bytes digest(HashAlgorithm algorithm, ByteView bytes) {
  Bytes result(hash_size(algorithm));
  hash_once(algorithm, bytes, result);
  return result;
}

Hasher::Hasher(HashAlgorithm algorithm) : algorithm_(algorithm), context_(EVP_MD_CTX_new()) {
  start(context_.get(), algorithm_);
}

void Hasher::update(ByteView bytes) {
  if (EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size()) != 1) fail();
}

Bytes Hasher::so_far() const {
  Bytes result(hash_size(algorithm_));
  const DigestContext copy(EVP_MD_CTX_new());
  if (!copy || EVP_MD_CTX_copy_ex(copy.get(), context_.get()) != 1 ||
      EVP_DigestFinal_ex(copy.get(), openssl_bytes(std::span<std::byte>(result)), nullptr) != 1) {
    fail();
  }
  return result;
}

}  // namespace kiroku::crypto
