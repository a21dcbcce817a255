// One thread for forces, deformation and pictures: forces get the rate they need, the others what is left.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>

namespace kiroku::sim {

/// Time as the scheduler sees it, so that tests can play it.
class SchedulerClock {
 public:
  virtual ~SchedulerClock() = default;
  virtual std::chrono::nanoseconds now() = 0;
  virtual void sleep_until(std::chrono::nanoseconds time) = 0;
};

/// CLOCK_MONOTONIC.
class MonotonicClock : public SchedulerClock {
 public:
  std::chrono::nanoseconds now() override;
  void sleep_until(std::chrono::nanoseconds time) override;
};

struct ScheduledWork {
  std::function<void()> forces, deformation, picture;
};

struct ScheduleReport {
  struct Share {
    std::uint64_t times = 0;
    std::chrono::nanoseconds spent{0};
    double rate_hz = 0;
  };
  Share forces, deformation, pictures;
  std::chrono::nanoseconds elapsed{0}, idle{0};
  std::uint64_t late_forces = 0;  // that began after they were due
  std::chrono::nanoseconds longest_between_forces{0};
};

/// Not thread-safe. Forces are due every 1 / rate. In between, deformation and pictures take turns, each when
/// what it took lately still fits in before the next forces. That estimate shrinks by kForget at each
/// refusal, so that one slow time does not shut work out, but not below the least it ever took: work that can
/// never fit is begun once, to find out. Where nothing fits, the thread sleeps.
class RateScheduler {
 public:
  /// kiroku::UsageError unless the rate is greater than zero and all work is there.
  RateScheduler(SchedulerClock& clock, ScheduledWork work, double force_rate_hz);

  /// For so long; may be called again, and goes on with what it learnt. Throws what the work throws.
  ScheduleReport run(std::chrono::nanoseconds budget);

  static constexpr double kForget = 0.99;

 private:
  struct Estimate {
    std::chrono::nanoseconds took{0}, least = std::chrono::nanoseconds::max();
    void forget();
  };
  std::chrono::nanoseconds perform(const std::function<void()>& work, Estimate& estimate,
                                   ScheduleReport::Share& share);

  SchedulerClock& clock_;
  ScheduledWork work_;
  std::chrono::nanoseconds interval_;
  Estimate forces_, deformation_, picture_;
  bool picture_next_ = false;
};

}  // namespace kiroku::sim
