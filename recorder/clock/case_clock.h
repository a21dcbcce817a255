// The one clock of a case: nanoseconds of CLOCK_MONOTONIC since it was started. Thread-safe but for
// restart().
#pragma once

#include <chrono>
#include <cstdint>

#include "archive/ledger_entry.h"

namespace kiroku::recorder {

class CaseClock {
 public:
  /// Starts at zero now.
  CaseClock() : zero_(std::chrono::steady_clock::now()) {}
  /// Zero is now: when every source is open and the case begins, before any thread reads the clock.
  void restart() { zero_ = std::chrono::steady_clock::now(); }
  [[nodiscard]] std::int64_t now_ns() const { return at_ns(std::chrono::steady_clock::now()); }
  [[nodiscard]] std::int64_t at_ns(std::chrono::steady_clock::time_point time) const {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(time - zero_).count();
  }
  /// Case-clock time with the machine's opinion of UTC beside it.
  [[nodiscard]] archive::Moment moment() const { return {utc_now(), now_ns()}; }

 private:
  std::chrono::steady_clock::time_point zero_;
};

}  // namespace kiroku::recorder
