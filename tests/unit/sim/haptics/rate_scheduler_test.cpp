#include "sim/haptics/rate_scheduler.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/haptics/haptic_rate.h"

namespace kiroku::sim {
namespace {

using namespace std::chrono_literals;
using std::chrono::nanoseconds;

/// Time that passes where work takes it.
class PlayedClock : public SchedulerClock {
 public:
  nanoseconds now() override { return now_; }
  void sleep_until(nanoseconds time) override { now_ = std::max(now_, time); }
  std::function<void()> work(nanoseconds takes) {
    return [this, takes] { now_ += takes; };
  }

 private:
  nanoseconds now_{1000s};
};

TEST(RateScheduler, ForcesHaveTheirRateAndTheRestIsShared) {
  PlayedClock clock;
  RateScheduler scheduler(clock, {clock.work(2ms), clock.work(10ms), clock.work(5ms)}, haptic_rate_hz(1));
  const ScheduleReport report = scheduler.run(10s);
  EXPECT_GE(report.forces.rate_hz, 23.2);
  EXPECT_LE(report.forces.rate_hz, 23.4);
  // Nothing is known of the others before they ran once.
  EXPECT_LE(report.late_forces, 2U);
  EXPECT_LE(report.longest_between_forces, 58ms);
  EXPECT_NEAR(static_cast<double>(report.deformation.times), static_cast<double>(report.pictures.times), 240);
  EXPECT_GT(report.deformation.times, 400U);
  EXPECT_GT(report.pictures.times, 400U);
  EXPECT_EQ(report.forces.spent + report.deformation.spent + report.pictures.spent + report.idle,
            report.elapsed);
  EXPECT_EQ(report.deformation.spent, report.deformation.times * 10ms);
  EXPECT_LT(report.idle, 2s);
}

TEST(RateScheduler, WorkThatCannotFitIsBegunOnce) {
  PlayedClock clock;
  RateScheduler scheduler(clock, {clock.work(1ms), clock.work(200ms), clock.work(3ms)}, 100);
  const ScheduleReport report = scheduler.run(20s);
  EXPECT_EQ(report.deformation.times, 1U);
  EXPECT_EQ(report.late_forces, 1U);
  EXPECT_GE(report.forces.rate_hz, 98.9);
  EXPECT_GT(report.pictures.rate_hz, 190);
  EXPECT_EQ(scheduler.run(20s).late_forces, 0U);
}

TEST(RateScheduler, OneSlowTimeDoesNotShutWorkOut) {
  PlayedClock clock;
  int times = 0;
  const auto slow_once = [&] { clock.work(++times == 50 ? 300ms : 4ms)(); };
  RateScheduler scheduler(clock, {clock.work(1ms), slow_once, clock.work(3ms)}, 100);
  const ScheduleReport report = scheduler.run(20s);
  EXPECT_EQ(report.late_forces, 1U);
  EXPECT_GT(report.deformation.times, 1000U);
}

TEST(RateScheduler, ForcesThatTakeTheirWholeTimeLeaveNothing) {
  PlayedClock clock;
  RateScheduler scheduler(clock, {clock.work(12ms), clock.work(1ms), clock.work(1ms)}, 100);
  const ScheduleReport report = scheduler.run(1s);
  EXPECT_EQ(report.deformation.times + report.pictures.times, 0U);
  EXPECT_EQ(report.late_forces, report.forces.times - 1);
  EXPECT_NEAR(report.forces.rate_hz, 1000.0 / 12, 1);
}

TEST(RateScheduler, RunsAgainstTheRealClock) {
  MonotonicClock clock;
  int forces = 0;
  RateScheduler scheduler(clock, {[&] { ++forces; }, [] {}, [] {}}, 200);
  const ScheduleReport report = scheduler.run(50ms);
  EXPECT_GE(report.elapsed, 50ms);
  EXPECT_EQ(report.forces.times, static_cast<std::uint64_t>(forces));
  EXPECT_GE(forces, 1);
  EXPECT_LE(forces, 11 + static_cast<int>(report.elapsed / 5ms));
}

TEST(RateScheduler, RefusesARateAndWorkWithoutSense) {
  PlayedClock clock;
  const auto work = clock.work(1ms);
  EXPECT_THROW(RateScheduler(clock, {work, work, work}, 0), UsageError);
  EXPECT_THROW(RateScheduler(clock, {work, nullptr, work}, 10), UsageError);
}

}  // namespace
}  // namespace kiroku::sim
