// Reading small files and writing outputs that are wholly there or not at all. Functions are thread-safe,
// objects are not.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "base/bytes.h"

namespace kiroku::apps {

inline constexpr std::size_t kLargestSmallFile = 16U << 20;

/// The whole file; refuses more than `most_bytes`, whole MiB. `what` for errors: "the subject".
Bytes read_small_file(const std::filesystem::path& file, const std::string& what,
                      std::size_t most_bytes = kLargestSmallFile);

/// Whether others than its owner may do anything with it: then it is no place for a secret. Throws
/// kiroku::IoError.
bool is_open_to_others(const std::filesystem::path& file);

/// A file seen in memory without reading it at once. Immutable; thread-safe.
class MappedFile {
 public:
  /// Throws kiroku::IoError, kiroku::UsageError for what is no regular file.
  explicit MappedFile(const std::filesystem::path& file);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;
  [[nodiscard]] ByteView bytes() const { return {data_, size_}; }

 private:
  const std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace kiroku::apps
