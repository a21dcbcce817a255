#include "recorder/daemon/disk_hours.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::recorder {
namespace {

using Known = RoomRate::Known;

constexpr std::uint64_t kGigabyte = 1'000'000'000;

TEST(DiskHours, TakesTheBestThatIsKnownOfARoom) {
  EXPECT_EQ(rate_of("a", 5, 4, 3).known, Known::kNow);
  EXPECT_EQ(rate_of("a", 0, 4, 3).known, Known::kLastCase);
  EXPECT_EQ(rate_of("a", 0, 0, 3).known, Known::kConfigured);
  EXPECT_EQ(rate_of("a", 0, 0, {}).known, Known::kNot);
  EXPECT_EQ(rate_of("a", 0, 4, 3).bytes_per_second, 4);
}

TEST(DiskHours, CountsTheBitRatesOfAllVideoAndWhatLiesAroundThem) {
  VideoProfile one;
  one.bit_rate = 4'000'000;
  EXPECT_DOUBLE_EQ(configured_bytes_per_second({one, one}).value(), 1'080'000);
  VideoProfile lossless;
  lossless.profile = Profile::kLossless;
  EXPECT_FALSE(configured_bytes_per_second({one, lossless}));
  EXPECT_FALSE(configured_bytes_per_second({}));
}

TEST(DiskHours, SaysWhatItAssumesOfEachRoom) {
  const DiskHours found = disk_hours(
      36 * kGigabyte,
      {{"or-1", Known::kConfigured, 2e6}, {"or-2", Known::kNow, 2e6}, {"or-3", Known::kConfigured, 1e6}});
  EXPECT_DOUBLE_EQ(found.hours.value(), 2);
  EXPECT_EQ(found.assumes, "or-2 as it records now; or-1, or-3 by the bit rate in kiroku.toml");
}

TEST(DiskHours, IsNotGuessedWhereARoomIsNotKnown) {
  const DiskHours found = disk_hours(kGigabyte, {{"or-1", Known::kNow, 2e6}, {"or-2", Known::kNot, 0}});
  EXPECT_FALSE(found.hours);
  EXPECT_EQ(found.assumes, "or-1 as it records now; or-2 not known before its first case");
  EXPECT_FALSE(disk_hours(kGigabyte, {}).hours);
}

}  // namespace
}  // namespace kiroku::recorder
