// Random-access bytes that are read, never written: a file, or memory.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

#include "base/bytes.h"

namespace kiroku::crypto {

/// Random-access bytes; implementations must allow read_at from several threads at once.
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  [[nodiscard]] virtual std::uint64_t size() const = 0;
  /// Fills `into` from `offset` on; fewer bytes only at the end. Throws kiroku::IoError.
  virtual std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const = 0;
};

/// A file opened for reading; its size is the one at this moment. Throws kiroku::IoError; kiroku::UsageError
/// for what is no regular file (pipes are read with unseal_stream).
std::unique_ptr<ByteSource> open_file_source(const std::filesystem::path& file);
/// Bytes in memory, which must outlive the source.
std::unique_ptr<ByteSource> memory_source(ByteView bytes);

}  // namespace kiroku::crypto
