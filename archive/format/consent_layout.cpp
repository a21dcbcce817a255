#include "archive/format/consent_layout.h"

#include <algorithm>

#include "crypto/encoding.h"

namespace kiroku::archive {

namespace {

constexpr std::string_view kSuffix = ".age";

}  // namespace

std::string consent_path(const crypto::Sha256Digest& sha256) {
  return std::string(kConsentsFolder) + "/" + crypto::to_hex(sha256) + std::string(kSuffix);
}

std::optional<crypto::Sha256Digest> hash_of_consent_path(std::string_view path) {
  const std::size_t before = kConsentsFolder.size() + 1;
  if (path.size() <= before + kSuffix.size()) {
    return std::nullopt;
  }
  const std::optional<Bytes> bytes =
      crypto::from_hex(path.substr(before, path.size() - before - kSuffix.size()));
  crypto::Sha256Digest hash{};
  if (!bytes || bytes->size() != hash.size()) {
    return std::nullopt;
  }
  std::ranges::copy(*bytes, hash.begin());
  return consent_path(hash) == path ? std::optional(hash) : std::nullopt;
}

}  // namespace kiroku::archive
