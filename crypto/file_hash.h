// Size and SHA-256 of a file, read piece by piece. Thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>

#include "crypto/hash.h"

namespace kiroku::crypto {

struct FileHash {
  std::uint64_t bytes = 0;
  Sha256Digest sha256{};
};

/// Links are followed. Throws kiroku::IoError where the file cannot be read, kiroku::Error for a pipe, a
/// socket or a device, which may give no end of bytes, or none at all.
FileHash hash_file(const std::filesystem::path& file);

}  // namespace kiroku::crypto
