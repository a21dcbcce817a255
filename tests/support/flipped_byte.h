// Damages a file in place, whatever stands in it.
#pragma once

#include <filesystem>
#include <fstream>
#include <ios>

#include <gtest/gtest.h>

namespace kiroku::test {

/// Flips one bit of the byte `at`, counted from the beginning of `file`, or from its end where it is negative
/// (-1 is the last byte). A fixed character in its place would damage nothing where it stands there already:
/// once in 256 files of ciphertext.
inline void flip_byte(const std::filesystem::path& file, std::streamoff at) {
  std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
  const auto from = at < 0 ? std::ios::end : std::ios::beg;
  bytes.seekg(at, from);
  const char flipped = static_cast<char>(bytes.get() ^ 1);
  bytes.seekp(at, from);
  bytes.put(flipped).flush();
  ASSERT_TRUE(bytes) << file << " has no byte " << at;
}

}  // namespace kiroku::test
