// Writing much to the disk without filling the page cache with it.
#pragma once

#include <cstdint>

namespace kiroku {

/// For a file that is written from front to back, once, and read much later if at all. The kernel is asked to
/// write back what is new, and to give up the pages of what was written some way before, so that few of them
/// serve for the whole file: what would fill memory costs the pages of everybody else, and a virtual
/// machine's host more time than the writing itself (docs/results/performance.md). Nothing waits for the
/// disk, and nothing becomes durable by it: errors appear at the next fdatasync. One thread at a time.
class WriteBehind {
 public:
  /// The descriptor must outlive this.
  explicit WriteBehind(int file_descriptor) : descriptor_(file_descriptor) {}
  /// Bytes before `end` were written, but for a few that other threads may be about to. May be called after
  /// each write.
  void wrote_until(std::uint64_t end);

 private:
  int descriptor_;
  std::uint64_t handed_over_ = 0;
};

}  // namespace kiroku
