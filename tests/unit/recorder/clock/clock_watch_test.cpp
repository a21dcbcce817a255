#include "recorder/clock/clock_watch.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/nanoseconds.h"

namespace kiroku::recorder {
namespace {

constexpr std::int64_t kTick = 200 * kMs;

/// A machine whose crystal, corrections and wall clock the test decides.
class ClockWatchTest : public testing::Test {
 protected:
  ClockWatchTest() { stated_ = watch_.check(); }
  /// Lets time go on, looking each fifth of a second; the first entry, and when it came.
  std::optional<archive::ClockEntry> run(std::int64_t duration_ns) {
    const std::int64_t start_ns = raw_ns_;
    while (raw_ns_ - start_ns < duration_ns) {
      raw_ns_ += kTick;
      // What the kernel makes of the crystal's time.
      corrected_ns_ += static_cast<double>(kTick) * (1 + rate_ppm_ * 1e-6);
      if (auto entry = watch_.check()) {
        after_ns_ = raw_ns_ - start_ns;
        return entry;
      }
    }
    return {};
  }

  std::int64_t raw_ns_ = 5'000 * kSecond;
  double corrected_ns_ = 0;
  std::int64_t wall_minus_case_ns_ = 1'700'000'000 * kSecond;
  std::int64_t uncertainty_ns_ = 300;
  double rate_ppm_ = 0;
  KernelClock kernel_{true, 12, 34};
  ClockWatch watch_{{[this] {
                       const auto case_ns = static_cast<std::int64_t>(std::llround(corrected_ns_));
                       return ClockReading{case_ns, case_ns + wall_minus_case_ns_, raw_ns_, uncertainty_ns_};
                     },
                     [this] { return kernel_; }}};
  std::optional<archive::ClockEntry> stated_;
  std::int64_t after_ns_ = 0;
};

TEST_F(ClockWatchTest, StatesTheKernelsOpinionAtTheBeginning) {
  ASSERT_TRUE(stated_);
  EXPECT_TRUE(stated_->synchronised);
  EXPECT_EQ(stated_->offset_ns, 12);
  EXPECT_EQ(stated_->error_ns, 34);
  EXPECT_EQ(stated_->step_ns, 0);
  EXPECT_FALSE(stated_->rate_ppb) << "there is nothing to compare with yet";
}

TEST_F(ClockWatchTest, StatesTheRateEachMinute) {
  rate_ppm_ = 20;  // a crystal that is corrected, as every synchronised machine does
  const auto entry = run(61 * kSecond);
  ASSERT_TRUE(entry);
  EXPECT_EQ(after_ns_, 60 * kSecond);
  ASSERT_TRUE(entry->rate_ppb);
  EXPECT_NEAR(static_cast<double>(*entry->rate_ppb), 20'000, 1);
  EXPECT_EQ(entry->step_ns, 0);
}

TEST_F(ClockWatchTest, SeesAStepOfTheWallClockAtTheNextLookBothWays) {
  for (const std::int64_t step_ns : {3'600 * kSecond, -3'600 * kSecond, 11 * kMs, -kSecond}) {
    run(3 * kSecond);
    wall_minus_case_ns_ += step_ns;
    const auto entry = run(kSecond);
    ASSERT_TRUE(entry);
    EXPECT_EQ(after_ns_, kTick);
    EXPECT_EQ(entry->step_ns, step_ns);
    EXPECT_NEAR(static_cast<double>(entry->rate_ppb.value_or(1'000'000)), 0, 10) << "a step is no slew";
    EXPECT_FALSE(run(2 * kSecond)) << "and is stated once";
  }
}

TEST_F(ClockWatchTest, StatesSmallStepsOnceTogetherTheyAreLarge) {
  for (int i = 0; i < 2; ++i) {
    wall_minus_case_ns_ += 4 * kMs;
    EXPECT_FALSE(run(kSecond)) << i;
  }
  wall_minus_case_ns_ += 4 * kMs;
  const auto entry = run(kSecond);
  ASSERT_TRUE(entry);
  EXPECT_EQ(entry->step_ns, 12 * kMs);
}

TEST_F(ClockWatchTest, SeesASlewWithinASecondAndItsEnd) {
  for (const double ppm : {500.0, -500.0, 210.0, 80'000.0}) {
    rate_ppm_ = 0;
    run(3 * kSecond);
    rate_ppm_ = ppm;
    const auto began = run(2 * kSecond);
    ASSERT_TRUE(began) << ppm;
    EXPECT_LE(after_ns_, kSecond) << ppm;
    EXPECT_GT(std::abs(began->rate_ppb.value_or(0)), archive::kSlewPpb) << ppm;
    const auto whole = run(2 * kSecond);
    ASSERT_TRUE(whole) << "the slew began within the second that showed it";
    EXPECT_NEAR(static_cast<double>(whole->rate_ppb.value_or(0)), ppm * 1000, std::abs(ppm) * 1000 * 0.01);
    EXPECT_FALSE(run(20 * kSecond)) << "a slew that goes on is stated each minute";
    rate_ppm_ = 0;
    const auto ended = run(2 * kSecond);
    ASSERT_TRUE(ended) << ppm;
    EXPECT_LE(after_ns_, kSecond) << ppm;
    // Over the whole slew, its last tail included.
    EXPECT_NEAR(static_cast<double>(ended->rate_ppb.value_or(0)), ppm * 1000, std::abs(ppm) * 1000 * 0.05);
    EXPECT_EQ(ended->step_ns, 0);
  }
}

// chrony slews by 83,333 ppm; the second that shows that may have begun just before it.
TEST_F(ClockWatchTest, StatesTheWholeRateTwoSecondsAfterASlewBegan) {
  run(3 * kSecond);
  corrected_ns_ -= 0.03 * static_cast<double>(kTick) * 83'333e-6;  // it began late in a tick
  rate_ppm_ = 83'333;
  double stated_ppb = 0;
  for (std::int64_t passed_ns = 0; passed_ns < 2 * kSecond; passed_ns += after_ns_) {
    const auto entry = run(2 * kSecond - passed_ns);
    if (!entry) break;
    stated_ppb = static_cast<double>(entry->rate_ppb.value_or(0));
  }
  EXPECT_NEAR(stated_ppb, 83'333'000, 83'333'000 * 0.01);
}

TEST_F(ClockWatchTest, StatesASlewAgainWhenItBecomesFasterOrSlower) {
  rate_ppm_ = 500;
  run(2 * kSecond);
  run(2 * kSecond);
  for (const double ppm : {80'000.0, 20'000.0, -80'000.0}) {
    run(20 * kSecond);
    rate_ppm_ = ppm;
    double stated_ppb = 0;
    std::int64_t passed_ns = 0;
    while (const auto entry = run(5 * kSecond)) {
      stated_ppb = static_cast<double>(entry->rate_ppb.value_or(0));
      passed_ns += after_ns_;
    }
    EXPECT_NEAR(stated_ppb, ppm * 1000, std::abs(ppm) * 1000 / 5) << ppm;
    EXPECT_LE(passed_ns, 3 * kSecond) << ppm;
  }
}

TEST_F(ClockWatchTest, SaysNothingMoreOfASlewThatChangesByLessThanAFifth) {
  rate_ppm_ = 50'000;
  run(2 * kSecond);
  run(2 * kSecond);
  for (const double ppm : {55'000.0, 45'000.0, 58'000.0}) {
    rate_ppm_ = ppm;
    EXPECT_FALSE(run(10 * kSecond)) << ppm;
  }
}

TEST_F(ClockWatchTest, AClockThatSwingsFillsNoLedger) {
  constexpr std::int64_t kLong = 600 * kSecond;
  int entries = 0;
  double gained_ns = 0, stated_ns = 0;
  std::int64_t stated_at_ns = raw_ns_;
  for (int second = 0; second < kLong / kSecond; ++second) {
    const double before_ns = corrected_ns_;
    rate_ppm_ = second % 4 < 2 ? 0 : 1'000.0 * (1 + second % 80);
    const std::int64_t until_ns = raw_ns_ + kSecond;
    while (raw_ns_ < until_ns) {
      if (const auto entry = run(until_ns - raw_ns_)) {
        ++entries;
        stated_ns += static_cast<double>(entry->rate_ppb.value_or(0)) *
                     static_cast<double>(raw_ns_ - stated_at_ns) / 1e9;
        stated_at_ns = raw_ns_;
      }
    }
    gained_ns += corrected_ns_ - before_ns - static_cast<double>(kSecond);
  }
  EXPECT_GT(entries, 20);
  EXPECT_LE(entries,
            ClockWatch::kMostSlewsAtOnce + kLong / ClockWatch::kSlewEveryNs + kLong / (60 * kSecond));
  EXPECT_GT(stated_ns, gained_ns * 0.9) << "what no entry of its own says is in the next one's mean";
}

TEST_F(ClockWatchTest, TakesNoCrystalForASlew) {
  // Crystals are right to 100 ppm, and that is what a synchronised kernel corrects.
  for (const double ppm : {100.0, -100.0, 190.0}) {
    rate_ppm_ = ppm;
    EXPECT_FALSE(run(30 * kSecond)) << ppm;
    rate_ppm_ = 0;
    run(31 * kSecond);
  }
}

TEST_F(ClockWatchTest, TakesNoInterruptedReadingForAStepOrSlew) {
  run(2 * kSecond);
  // The thread was put aside for 5 ms in the middle of each attempt to read.
  uncertainty_ns_ = 5 * kMs;
  wall_minus_case_ns_ += 4 * kMs;
  raw_ns_ += 4 * kMs;
  EXPECT_FALSE(run(kTick));
  uncertainty_ns_ = 300;
  wall_minus_case_ns_ -= 4 * kMs;
  raw_ns_ -= 4 * kMs;
  EXPECT_FALSE(run(5 * kSecond));
}

TEST(ReadClocks, ReadsThisMachinesClocksAsOneInstant) {
  const CaseClock clock;
  const ClockReading first = read_clocks(clock);
  const ClockReading second = read_clocks(clock);
  EXPECT_GE(second.case_ns, first.case_ns);
  EXPECT_GE(second.raw_ns, first.raw_ns);
  EXPECT_LT(first.uncertainty_ns, 10 * kMs);
  const std::int64_t now_ns =
      std::chrono::duration_cast<std::chrono::nanoseconds>(utc_now().time_since_epoch()).count();
  EXPECT_LT(std::abs(now_ns - second.wall_ns), kSecond);
  EXPECT_GE(read_kernel_clock().error_ns, 0);
}

}  // namespace
}  // namespace kiroku::recorder
