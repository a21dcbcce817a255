// SHA-2 (FIPS 180-4) and SHA-3 (FIPS 202) over OpenSSL. Objects are not thread-safe; free functions are.
#pragma once

#include <array>
#include <compare>
#include <filesystem>
#include <memory>
#include <optional>
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

/// The hash functions that time-stamp imprints and evidence records use here.
/// SHA-224 is there to tell what old records say: nothing counts that rests on it.
enum class HashAlgorithm { kSha256, kSha384, kSha512, kSha3_256, kSha3_384, kSha3_512, kSha224 };
/// Those that count.
inline constexpr std::array kHashAlgorithms{HashAlgorithm::kSha256,   HashAlgorithm::kSha384,
                                            HashAlgorithm::kSha512,   HashAlgorithm::kSha3_256,
                                            HashAlgorithm::kSha3_384, HashAlgorithm::kSha3_512};
std::string_view hash_name(HashAlgorithm algorithm);  // "sha256", "sha3-512", …
/// The one of them that hash_name() calls so; nothing for other names.
std::optional<HashAlgorithm> hash_named(std::string_view name);
std::size_t hash_size(HashAlgorithm algorithm);  // bytes
Bytes digest(HashAlgorithm algorithm, ByteView bytes);

/// Any of them over a stream of bytes.
class Hasher {
 public:
  explicit Hasher(HashAlgorithm algorithm);
  void update(ByteView bytes);
  /// The digest of everything so far; the object goes on behind it.
  [[nodiscard]] Bytes so_far() const;

 private:
  HashAlgorithm algorithm_;
  DigestContext context_;
};

}  // namespace kiroku::crypto
