// What changes when a file is written, replaced or removed: by what is remembered of a case for as long as
// its files stay. Root, and whoever writes to the disk itself, can leave it as it was. A function;
// thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <sys/stat.h>

namespace kiroku::viewer {

/// Inode, bytes, time of change of content and of anything (ns since 1970). Of a file that is not there:
/// zeros.
using FileStamp = std::array<std::int64_t, 4>;

inline FileStamp file_stamp(const std::filesystem::path& file) {
  struct stat state {};
  if (::lstat(file.c_str(), &state) != 0) return {};
  constexpr std::int64_t kNsPerSecond = 1'000'000'000;
  return {static_cast<std::int64_t>(state.st_ino), state.st_size,
          state.st_mtim.tv_sec * kNsPerSecond + state.st_mtim.tv_nsec,
          state.st_ctim.tv_sec * kNsPerSecond + state.st_ctim.tv_nsec};
}

}  // namespace kiroku::viewer
