// How often one browser may point: a bucket that fills again with time. One thread at a time.
#pragma once

#include <algorithm>
#include <chrono>

#include "base/clock.h"

namespace kiroku::viewer {

class PointRate {
 public:
  /// A page points 20 times a second at most.
  static constexpr double kPerSecond = 30;
  static constexpr double kAtOnce = 30;

  explicit PointRate(Clock::Time now) : last_(now) {}
  bool take(Clock::Time now) {
    const std::chrono::duration<double> passed = now - last_;
    last_ = now;
    left_ = std::min(kAtOnce, left_ + passed.count() * kPerSecond);
    if (left_ < 1) return false;
    left_ -= 1;
    return true;
  }

 private:
  Clock::Time last_;
  double left_ = kAtOnce;
};

}  // namespace kiroku::viewer
