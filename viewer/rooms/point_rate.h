// How often one person may point, by however many browsers: a bucket that fills again with time.
#pragma once

#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "base/clock.h"

namespace kiroku::viewer {

/// One thread at a time.
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

/// One bucket a person, kept while one of their browsers is there. Thread-safe.
class PointRates {
 public:
  class Shared {
   public:
    explicit Shared(Clock::Time now) : rate_(now) {}
    bool take(Clock::Time now) {
      const std::lock_guard guard(mutex_);
      return rate_.take(now);
    }

   private:
    std::mutex mutex_;
    PointRate rate_;
  };
  /// `person` as Session::person().
  std::shared_ptr<Shared> of(const std::string& person, Clock::Time now) {
    const std::lock_guard guard(mutex_);
    std::erase_if(rates_, [](const auto& each) { return each.second.expired(); });
    std::weak_ptr<Shared>& known = rates_[person];
    std::shared_ptr<Shared> rate = known.lock();
    if (!rate) known = rate = std::make_shared<Shared>(now);
    return rate;
  }

 private:
  std::mutex mutex_;
  std::map<std::string, std::weak_ptr<Shared>> rates_;
};

}  // namespace kiroku::viewer
