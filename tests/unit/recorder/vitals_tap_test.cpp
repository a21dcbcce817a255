#include "recorder/vitals_tap.h"

#include <vector>

#include <gtest/gtest.h>

namespace kiroku::recorder {
namespace {

media::VitalSample sample(std::int64_t time_ns) {
  media::VitalSample one;
  one.time_ns = time_ns;
  one.code = "MDC_ECG_HEART_RATE";
  one.value = 60;
  return one;
}

/// Times of what was taken; -1 where a session begins.
std::vector<std::int64_t> taken(VitalsTap& tap) {
  std::vector<std::int64_t> times;
  tap.take([&](const media::VitalLine* line) {
    times.push_back(line == nullptr ? -1 : media::time_ns_of(*line));
  });
  return times;
}

TEST(VitalsTap, HandsOnSamplesAndWhereAClockBegins) {
  VitalsTap tap;
  tap.begin();
  tap.offer(sample(1));
  tap.offer(sample(2));
  tap.begin();
  tap.offer(sample(1));
  EXPECT_EQ(taken(tap), (std::vector<std::int64_t>{-1, 1, 2, -1, 1}));
  EXPECT_EQ(tap.lost(), 0U);
}

TEST(VitalsTap, KeepsNothingThatNamesAPatient) {
  VitalsTap tap;
  tap.offer(media::DeviceMessage{1, "PID|1||17||Yamada", "AA", "bed-3"});
  EXPECT_TRUE(taken(tap).empty());
}

TEST(VitalsTap, LosesWhatNobodyTakesAndNeverMixesTwoClocks) {
  VitalsTap tap;
  constexpr std::size_t kMore = 10;
  for (std::size_t i = 0; i < VitalsTap::kMostWaiting + kMore; ++i) tap.offer(sample(1));
  EXPECT_EQ(tap.lost(), kMore);
  tap.begin();
  EXPECT_EQ(taken(tap).size(), VitalsTap::kMostWaiting);
  tap.offer(sample(5));
  EXPECT_EQ(taken(tap), (std::vector<std::int64_t>{-1, 5}));
}

}  // namespace
}  // namespace kiroku::recorder
