#include "recorder/clock/sleep_watch.h"

#include <algorithm>
#include <chrono>

namespace kiroku::recorder {
namespace {

constexpr std::chrono::milliseconds kGoodReading{1};
constexpr int kMostReadings = 10;
constexpr std::size_t kMostRemembered = 64;
// A source that makes up for what it is behind fills the end of a sleep: by a second at most, if it is ours.
constexpr std::int64_t kMadeUpNs = 1'000'000'000;

}  // namespace

SleepWatch::SleepWatch(const CaseClock& clock) : clock_(clock) { look(); }

void SleepWatch::look() {
  const Clock& time = clock_.time();
  for (int i = 0; i < kMostReadings; ++i) {
    const Clock::Time before = time.now();
    const std::chrono::nanoseconds since_boot = time.since_boot();
    const Clock::Time after = time.now();
    if (after - before > kGoodReading) continue;
    const std::int64_t suspended_ns = (since_boot - before.time_since_epoch()).count();
    const std::int64_t now_ns = clock_.at_ns(since_boot);
    const std::int64_t length_ns = suspended_ns - suspended_ns_;
    if (looked_ns_ != INT64_MIN && length_ns < kShortestNs) {
      looked_ns_ = now_ns;
      return;
    }
    if (looked_ns_ != INT64_MIN) sleeps_.push_back({looked_ns_, now_ns, length_ns});
    if (sleeps_.size() > kMostRemembered) sleeps_.pop_front();
    suspended_ns_ = suspended_ns;
    looked_ns_ = now_ns;
    return;
  }
}

bool SleepWatch::slept_within(std::int64_t from_ns, std::int64_t to_ns) {
  const std::lock_guard lock(mutex_);
  look();
  return std::any_of(sleeps_.begin(), sleeps_.end(), [&](const Sleep& sleep) {
    return sleep.after_ns < to_ns && from_ns < sleep.before_ns &&
           to_ns - from_ns >= std::max(sleep.length_ns / 2, sleep.length_ns - kMadeUpNs);
  });
}

}  // namespace kiroku::recorder
