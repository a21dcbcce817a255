#include "recorder/picture_tap.h"

#include <new>
#include <utility>

namespace kiroku::recorder {

void PictureTap::offer(const TimedFrame& picture) noexcept {
  if (!wanted_) return;
  ++offered_;
  std::optional<Picture> fresh;
  try {
    fresh = Picture{media::reference(*picture.frame), picture.time_ns, picture.rate};
  } catch (const std::bad_alloc&) {
    ++passed_over_;
    return;
  }
  {
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock) {
      ++passed_over_;
      return;
    }
    std::swap(newest_, fresh);
  }
  if (fresh) ++passed_over_;  // it waited in vain
  changed_.notify_one();
}

void PictureTap::watch(bool wanted) {
  std::optional<Picture> stale;
  const std::lock_guard guard(mutex_);
  wanted_ = wanted;
  std::swap(newest_, stale);
}

std::optional<PictureTap::Picture> PictureTap::take(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, patience, [this] { return newest_.has_value(); });
  return std::exchange(newest_, std::nullopt);
}

}  // namespace kiroku::recorder
