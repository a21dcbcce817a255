// The one clock of a case: nanoseconds of CLOCK_BOOTTIME since it was started. A machine that sleeps loses
// that time, and the case says so: by CLOCK_MONOTONIC it would be missing without a trace. Thread-safe but
// for restart().
#pragma once

#include <chrono>
#include <cstdint>

#include "archive/format/ledger_entry.h"
#include "base/clock.h"

namespace kiroku::recorder {

class CaseClock {
 public:
  /// Starts at zero now. `time` must outlive the clock and its copies.
  explicit CaseClock(const Clock& time = Clock::system()) : time_(&time), zero_(time.since_boot()) {}
  /// The clock of another process of this machine, by its zero_ns().
  explicit CaseClock(std::int64_t zero_ns) : time_(&Clock::system()), zero_(zero_ns) {}
  /// Zero is now: when every source is open and the case begins, before any thread reads the clock.
  void restart() { zero_ = time_->since_boot(); }
  [[nodiscard]] std::int64_t now_ns() const { return at_ns(time_->since_boot()); }
  /// Of a reading of Clock::since_boot().
  [[nodiscard]] std::int64_t at_ns(std::chrono::nanoseconds since_boot) const {
    return (since_boot - zero_).count();
  }
  /// Its zero on CLOCK_BOOTTIME.
  [[nodiscard]] std::int64_t zero_ns() const { return zero_.count(); }
  /// Case-clock time with the machine's opinion of UTC beside it.
  [[nodiscard]] archive::Moment moment() const { return {time_->utc(), now_ns()}; }
  /// What it counts.
  [[nodiscard]] const Clock& time() const { return *time_; }

 private:
  const Clock* time_;
  std::chrono::nanoseconds zero_;
};

}  // namespace kiroku::recorder
