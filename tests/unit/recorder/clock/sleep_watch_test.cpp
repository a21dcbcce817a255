#include "recorder/clock/sleep_watch.h"

#include <gtest/gtest.h>

#include "tests/support/moved_clock.h"
#include "tests/support/nanoseconds.h"

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;

constexpr std::int64_t kFrame = kSecond / 25;

class SleepWatchTest : public testing::Test {
 protected:
  test::MovedClock time_;
  CaseClock clock_{time_};
  SleepWatch watch_{clock_};
};

TEST_F(SleepWatchTest, TheCaseClockGoesOnWhileTheMachineSleeps) {
  time_.move(1s);
  EXPECT_EQ(clock_.now_ns(), kSecond);
  time_.suspend(60s);
  EXPECT_EQ(clock_.now_ns(), 61 * kSecond);
  time_.move(1s);
  EXPECT_EQ(clock_.now_ns(), 62 * kSecond);
}

TEST_F(SleepWatchTest, KnowsTheStretchInWhichTheMachineSlept) {
  time_.move(1s);
  EXPECT_FALSE(watch_.slept_within(kSecond - kFrame, kSecond));
  time_.suspend(60s);
  time_.move(20ms);
  const std::int64_t now_ns = clock_.now_ns();
  // A frame that waited to be recorded while the machine slept.
  EXPECT_FALSE(watch_.slept_within(kSecond - kFrame, kSecond));
  EXPECT_TRUE(watch_.slept_within(kSecond, now_ns));
  // Another stream, which asks later.
  time_.move(5s);
  EXPECT_TRUE(watch_.slept_within(kSecond - 5 * kFrame, now_ns + 3 * kFrame));
  EXPECT_FALSE(watch_.slept_within(now_ns, clock_.now_ns()));
}

TEST_F(SleepWatchTest, ASourceThatMakesUpForTheLastSecondWasAsleepAsWell) {
  time_.suspend(60s);
  const std::int64_t now_ns = clock_.now_ns();
  EXPECT_TRUE(watch_.slept_within(0, now_ns - kSecond));
  EXPECT_FALSE(watch_.slept_within(0, now_ns - 2 * kSecond));
}

TEST_F(SleepWatchTest, ASilenceIsNoSleep) {
  time_.move(60s);
  EXPECT_FALSE(watch_.slept_within(0, clock_.now_ns()));
}

TEST_F(SleepWatchTest, TellsOfEachSleepAndOfNoneThatIsAsShortAsAReading) {
  time_.suspend(20ms);
  EXPECT_FALSE(watch_.slept_within(0, clock_.now_ns()));
  for (int i = 0; i < 100; ++i) {
    const std::int64_t before_ns = clock_.now_ns();
    time_.suspend(1s);
    EXPECT_TRUE(watch_.slept_within(before_ns, clock_.now_ns())) << i;
  }
}

}  // namespace
}  // namespace kiroku::recorder
