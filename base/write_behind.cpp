#include "base/write_behind.h"

#include <algorithm>
#include <fcntl.h>

namespace kiroku {
namespace {

constexpr std::uint64_t kStep = 8U << 20U;
// What was handed over last is still on its way to the disk; asking for it would only find it busy.
constexpr std::uint64_t kBusy = 32U << 20U;
// Pages that were busy the last times are asked for again: a slow disk gets so much more time.
constexpr std::uint64_t kAskedAgain = 64U << 20U;

}  // namespace

void WriteBehind::wrote_until(std::uint64_t end) {
  if (end < handed_over_ + kStep) return;
  // Only hints: file systems that know nothing of them write back in their own time.
  (void)::sync_file_range(descriptor_, static_cast<off_t>(handed_over_),
                          static_cast<off_t>(end - handed_over_), SYNC_FILE_RANGE_WRITE);
  handed_over_ = end;
  if (end <= kBusy) return;
  const std::uint64_t until = end - kBusy;
  const std::uint64_t from = until - std::min(until, kAskedAgain);
  (void)::posix_fadvise(descriptor_, static_cast<off_t>(from), static_cast<off_t>(until - from),
                        POSIX_FADV_DONTNEED);
}

}  // namespace kiroku
