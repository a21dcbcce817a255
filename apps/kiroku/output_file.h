// An output that is wholly there or not at all: written as NAME.part, renamed when it is whole. Not
// thread-safe; one at a time in a program.
#pragma once

#include <filesystem>

#include "base/bytes.h"

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
  enum class Durability { kNow, kEventually };
  /// kNow: fsync of file and folder, for what may be the only copy from now on.
  void commit(Durability durability);

 private:
  std::filesystem::path name_, part_;
  int descriptor_ = -1;
  bool direct_ = false;
};

/// Everything to a descriptor such as standard output; throws kiroku::IoError naming `name_for_errors`.
void write_all(int descriptor, ByteView bytes, const std::filesystem::path& name_for_errors);

}  // namespace kiroku::apps
