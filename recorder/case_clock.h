// The one clock of a case: nanoseconds of CLOCK_MONOTONIC since it was started. Immutable; thread-safe.
#pragma once

#include <chrono>
#include <cstdint>

#include "archive/ledger_entry.h"

namespace kiroku::recorder {

class CaseClock {
 public:
  /// Starts at zero now.
  CaseClock() : zero_(std::chrono::steady_clock::now()) {}
  [[nodiscard]] std::int64_t now_ns() const {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now() - zero_)
        .count();
  }
  /// Case-clock time with the machine's opinion of UTC beside it.
  [[nodiscard]] archive::Moment moment() const { return {utc_now(), now_ns()}; }
  [[nodiscard]] std::chrono::steady_clock::time_point zero() const { return zero_; }

 private:
  std::chrono::steady_clock::time_point zero_;
};

}  // namespace kiroku::recorder
