// An output that is wholly there or not at all: written as NAME.part, renamed when it is whole. Not
// thread-safe; one at a time in a program.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "base/bytes.h"
#include "base/write_behind.h"

namespace kiroku::apps {

class OutputFile {
 public:
  /// What is neither absent nor a regular file (a pipe, /dev/null) is written directly. Throws
  /// kiroku::IoError, and kiroku::UsageError if NAME.part is there already. `mode` is that of open(2).
  explicit OutputFile(std::filesystem::path name, unsigned mode = 0666);
  /// Removes NAME.part if it was not committed; so do Ctrl-C and SIGTERM.
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  void write(ByteView bytes);
  /// For who writes by offset instead; -1 where that cannot be (a pipe).
  [[nodiscard]] int descriptor() const { return direct_ ? -1 : descriptor_; }
  [[nodiscard]] const std::filesystem::path& name() const { return name_; }
  enum class Durability { kNow, kEventually };
  /// kNow: fsync of file and folder, for what may be the only copy from now on.
  void commit(Durability durability);

 private:
  std::filesystem::path name_, part_;
  int descriptor_ = -1;
  bool direct_ = false;
  std::uint64_t written_ = 0;
  std::optional<WriteBehind> behind_;
};

/// Everything to a descriptor such as standard output; throws kiroku::IoError naming `name_for_errors`.
void write_all(int descriptor, ByteView bytes, const std::filesystem::path& name_for_errors);

}  // namespace kiroku::apps
