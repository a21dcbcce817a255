// When the machine was suspended while a case was recorded. Thread-safe.
#pragma once

#include <cstdint>
#include <deque>
#include <mutex>

#include "recorder/clock/case_clock.h"

namespace kiroku::recorder {

class SleepWatch {
 public:
  /// Shorter sleeps are not told of: two clocks cannot be read at one instant.
  static constexpr std::int64_t kShortestNs = 100'000'000;

  /// `clock` must outlive the object, and may be restarted before the first question.
  explicit SleepWatch(const CaseClock& clock);
  /// Whether the machine slept between these times of the case clock, of which the second is not later than
  /// now. To be asked of each stretch that nothing was recorded in, as soon as it is over.
  bool slept_within(std::int64_t from_ns, std::int64_t to_ns);

 private:
  struct Sleep {
    std::int64_t after_ns = 0, before_ns = 0;  // it lies between these
    std::int64_t length_ns = 0;
  };
  /// Both clocks are read; a thread that was interrupted in between learns nothing.
  void look();

  const CaseClock& clock_;
  std::mutex mutex_;
  std::deque<Sleep> sleeps_;  // the newest ones
  std::int64_t suspended_ns_ = 0;
  std::int64_t looked_ns_ = INT64_MIN;
};

}  // namespace kiroku::recorder
