// SHA-256 and SHA-512 (FIPS 180-4) over OpenSSL. Objects are not thread-safe; free functions are.
#pragma once

#include <array>
#include <compare>
#include <filesystem>
#include <memory>
#include <string_view>

#include "base/bytes.h"
#include "crypto/openssl_handles.h"

namespace kiroku::crypto {

using Sha256Digest = std::array<std::byte, 32>;

/// SHA-256 of a stream of bytes.
class Sha256 {
 public:
  Sha256();
  void update(ByteView bytes);
  /// The digest of everything since construction or the last finish(); the object starts afresh.
  Sha256Digest finish();

 private:
  DigestContext context_;
};

Sha256Digest sha256(ByteView bytes);

/// The hash functions that time-stamp imprints use here.
enum class HashAlgorithm { kSha256, kSha384, kSha512 };
std::string_view hash_name(HashAlgorithm algorithm);  // "sha256", …
std::size_t hash_size(HashAlgorithm algorithm);       // bytes
Bytes digest(HashAlgorithm algorithm, ByteView bytes);

}  // namespace kiroku::crypto
