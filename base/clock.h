// Time as the program sees it: what a clock shows, and waiting for it to show more. Whoever decides by time
// takes a Clock, so that a test can move it by hand (tests/support/moved_clock.h) instead of sleeping.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>

#include "base/utc_time.h"

namespace kiroku {

/// All functions are thread-safe. Measurements that are only reported need none of this: they read
/// std::chrono::steady_clock themselves.
class Clock {
 public:
  /// Monotonic; stands still while the machine is suspended (CLOCK_MONOTONIC).
  using Time = std::chrono::steady_clock::time_point;
  using Duration = std::chrono::steady_clock::duration;

  Clock() = default;
  virtual ~Clock() = default;
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;

  [[nodiscard]] virtual Time now() const = 0;
  /// Monotonic; goes on while the machine is suspended (CLOCK_BOOTTIME).
  [[nodiscard]] virtual Duration since_boot() const = 0;
  /// Wall time: testimony, never used for order or duration.
  [[nodiscard]] virtual UtcTime utc() const = 0;
  /// As std::condition_variable::wait_until(), by this clock: returns when `changed` is notified, at
  /// `deadline`, or spuriously. `lock` is held on return.
  virtual void wait_until(std::condition_variable& changed, std::unique_lock<std::mutex>& lock,
                          Time deadline) const = 0;

  /// Waits until `ready` or `deadline`; whether it is ready.
  template <typename Ready>
  bool wait_until(std::condition_variable& changed, std::unique_lock<std::mutex>& lock, Time deadline,
                  Ready ready) const {
    while (!ready()) {
      if (now() >= deadline) return false;
      wait_until(changed, lock, deadline);
    }
    return true;
  }
  template <typename Ready>
  bool wait_for(std::condition_variable& changed, std::unique_lock<std::mutex>& lock, Duration patience,
                Ready ready) const {
    return wait_until(changed, lock, now() + patience, std::move(ready));
  }

  /// The machine's.
  static const Clock& system();
};

}  // namespace kiroku
