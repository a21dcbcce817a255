// The one clock of a case: nanoseconds of CLOCK_MONOTONIC since it was started. Thread-safe but for
// restart().
#pragma once

#include <chrono>
#include <cstdint>

#include "archive/format/ledger_entry.h"
#include "base/clock.h"

namespace kiroku::recorder {

class CaseClock {
 public:
  /// Starts at zero now. `time` must outlive the clock and its copies.
  explicit CaseClock(const Clock& time = Clock::system()) : time_(&time), zero_(time.now()) {}
  /// The clock of another process of this machine, by its zero_ns().
  explicit CaseClock(std::int64_t zero_ns)
      : time_(&Clock::system()), zero_(std::chrono::nanoseconds(zero_ns)) {}
  /// Zero is now: when every source is open and the case begins, before any thread reads the clock.
  void restart() { zero_ = time_->now(); }
  [[nodiscard]] std::int64_t now_ns() const { return at_ns(time_->now()); }
  [[nodiscard]] std::int64_t at_ns(Clock::Time time) const {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(time - zero_).count();
  }
  /// Its zero on CLOCK_MONOTONIC.
  [[nodiscard]] std::int64_t zero_ns() const { return -at_ns({}); }
  /// Case-clock time with the machine's opinion of UTC beside it.
  [[nodiscard]] archive::Moment moment() const { return {time_->utc(), now_ns()}; }
  /// What it counts.
  [[nodiscard]] const Clock& time() const { return *time_; }

 private:
  const Clock* time_;
  Clock::Time zero_;
};

}  // namespace kiroku::recorder
