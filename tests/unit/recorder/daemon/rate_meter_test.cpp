#include "recorder/daemon/rate_meter.h"

#include <gtest/gtest.h>

namespace kiroku::recorder {
namespace {

using namespace std::chrono_literals;

TEST(RateMeter, KnowsNoRateOfOneMoment) {
  RateMeter meter;
  EXPECT_EQ(meter.bytes_per_second(), 0);
  meter.add(Clock::Time(1s), 1000);
  EXPECT_EQ(meter.bytes_per_second(), 0);
}

TEST(RateMeter, TellsBytesOverTheTimeBetween) {
  RateMeter meter;
  meter.add(Clock::Time(10s), 1000);
  meter.add(Clock::Time(10s + 500ms), 777'000);  // within the second, so it does not count
  meter.add(Clock::Time(14s), 9000);
  EXPECT_DOUBLE_EQ(meter.bytes_per_second(), 2000);
}

TEST(RateMeter, ForgetsWhatIsOverAMinuteOld) {
  RateMeter meter;
  // A burst, then a steady 100 bytes a second.
  meter.add(Clock::Time(0s), 0);
  meter.add(Clock::Time(1s), 1'000'000);
  for (int second = 2; second <= 200; ++second)
    meter.add(Clock::Time(std::chrono::seconds(second)),
              1'000'000 + 100 * static_cast<std::uint64_t>(second));
  EXPECT_DOUBLE_EQ(meter.bytes_per_second(), 100);
}

}  // namespace
}  // namespace kiroku::recorder
