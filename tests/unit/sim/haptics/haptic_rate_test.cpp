#include "sim/haptics/haptic_rate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

TEST(HapticRate, FallsWithTheNumberOfFingers) {
  EXPECT_EQ(haptic_rate_hz(0), 0);
  EXPECT_EQ(haptic_rate_hz(1), 23.3);
  EXPECT_EQ(haptic_rate_hz(5), 1.2);
  for (std::size_t fingers = 2; fingers <= 5; ++fingers)
    EXPECT_LT(haptic_rate_hz(fingers), haptic_rate_hz(fingers - 1));
  EXPECT_THROW((void)haptic_rate_hz(6), UsageError);
}

}  // namespace
}  // namespace kiroku::sim
