#include "recorder/daemon/disk_hours.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::recorder {
namespace {

using Known = RoomRate::Known;

constexpr std::uint64_t kGigabyte = 1'000'000'000;

TEST(DiskHours, TakesTheBestThatIsKnownOfARoom) {
  const ConfiguredRate configured{3};
  EXPECT_EQ(rate_of("a", 5, 4, configured).known, Known::kNow);
  EXPECT_EQ(rate_of("a", 0, 4, configured).known, Known::kLastCase);
  EXPECT_EQ(rate_of("a", 0, 0, configured).known, Known::kConfigured);
  EXPECT_EQ(rate_of("a", 0, 0, {}).known, Known::kNot);
  EXPECT_EQ(rate_of("a", 0, 4, configured).bytes_per_second, 4);
}

TEST(DiskHours, CountsTheBitRatesOfAllVideoAndWhatLiesAroundThem) {
  VideoProfile one;
  one.bit_rate = 4'000'000;
  const auto both = configured_bytes_per_second({{one, "/dev/video0"}, {one, "rtsp://10.0.0.1/a"}});
  EXPECT_DOUBLE_EQ(both.value().bytes_per_second, 1'080'000);
  EXPECT_FALSE(both->is_reckoned);
  EXPECT_FALSE(configured_bytes_per_second({}));
}

TEST(DiskHours, ReckonsWhatHasNoBitRateBySizeAndRateOfItsPictures) {
  const auto rate = [](Profile profile, const std::string& source) {
    VideoProfile video;
    video.profile = profile;
    const auto found = configured_bytes_per_second({{video, source}});
    EXPECT_TRUE(found && found->is_reckoned) << source;
    return found ? found->bytes_per_second : 0;
  };
  EXPECT_DOUBLE_EQ(rate(Profile::kUncompressed, "synthetic:endoscope?size=64x48&rate=5"), 64 * 48 * 2 * 5);
  EXPECT_DOUBLE_EQ(rate(Profile::kLossless, "/dev/video0?size=1280x720&rate=30000/1001"),
                   1280 * 720 * 2 * (30000 / 1001.0) * 0.6);
  constexpr double kUsual = 1920 * 1080 * 2 * 30;
  for (const char* source : {"rtsp://10.0.0.1/a", "/dev/video0", "", "/dev/video0?size=x&rate=fast"})
    EXPECT_DOUBLE_EQ(rate(Profile::kUncompressed, source), kUsual) << source;
  EXPECT_EQ(rate_of("a", 0, 0, ConfiguredRate{3, true}).known, Known::kReckoned);
}

TEST(DiskHours, SaysWhatItAssumesOfEachRoom) {
  const DiskHours found = disk_hours(
      36 * kGigabyte,
      {{"or-1", Known::kConfigured, 2e6}, {"or-2", Known::kNow, 2e6}, {"or-3", Known::kConfigured, 1e6}});
  EXPECT_DOUBLE_EQ(found.hours.value(), 2);
  EXPECT_EQ(found.assumes, "or-2 as it records now; or-1, or-3 by the bit rate in kiroku.toml");
}

TEST(DiskHours, AreAtMostThoseOfTheRoomsThatAreKnown) {
  const DiskHours found = disk_hours(72 * kGigabyte, {{"or-1", Known::kNow, 2e6}, {"or-2", Known::kNot, 0}});
  EXPECT_DOUBLE_EQ(found.hours.value(), 10);
  EXPECT_TRUE(found.are_at_most);
  EXPECT_EQ(found.assumes, "or-1 as it records now; or-2 not known before its first case");
  EXPECT_FALSE(disk_hours(kGigabyte, {{"or-1", Known::kNow, 2e6}}).are_at_most);
  EXPECT_FALSE(disk_hours(kGigabyte, {}).hours);
}

TEST(DiskHours, ANearlyFullDiskIsShortThoughNobodyKnowsForHowLong) {
  const auto is_short_of = [](std::uint64_t free_bytes, std::vector<RoomRate> rooms) {
    return is_short(disk_hours(free_bytes, rooms), free_bytes, rooms.size(), 8);
  };
  const RoomRate unknown{"or-1", Known::kNot, 0}, known{"or-2", Known::kNow, 1e6};
  EXPECT_TRUE(is_short_of(kGigabyte / 2, {unknown}));
  EXPECT_TRUE(is_short_of(20 * kGigabyte, {unknown, unknown})) << "each needs as much";
  EXPECT_FALSE(is_short_of(20 * kGigabyte, {unknown}));
  EXPECT_TRUE(is_short_of(20 * kGigabyte, {unknown, known}));
  EXPECT_FALSE(is_short_of(40 * kGigabyte, {unknown, known}));
}

}  // namespace
}  // namespace kiroku::recorder
