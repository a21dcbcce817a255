// An appliance log in which nothing stands yet: the machine stopped before the first entry.
#pragma once

#include <filesystem>

namespace kiroku::test {

/// Whether the log is there and holds no byte. Nobody signed anything then, and it must not read as if.
inline bool is_empty_log(const std::filesystem::path& folder) {
  std::error_code none;
  const std::uintmax_t bytes = std::filesystem::file_size(folder / "ledger.jsonl", none);
  return !none && bytes == 0;
}

}  // namespace kiroku::test
