// Real material that is not part of the project: tests that need it say so and are skipped without it.
#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "base/bytes.h"
#include "tests/support/build_paths.h"

namespace kiroku::test {

/// Below "shared/data" beside the source tree.
inline std::filesystem::path shared_data(const std::string& relative) {
  return source_folder().parent_path() / "shared" / "data" / relative;
}

inline Bytes read_whole(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return to_bytes(std::string((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>()));
}

}  // namespace kiroku::test

/// Skips the running test where `relative` is absent.
#define KIROKU_NEEDS_SHARED_DATA(relative)                                            \
  if (!std::filesystem::exists(kiroku::test::shared_data(relative))) {                \
    GTEST_SKIP() << "needs " << kiroku::test::shared_data(relative) << ", not there"; \
  }
