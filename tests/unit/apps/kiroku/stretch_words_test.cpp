#include "apps/kiroku/stretch_words.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/nanoseconds.h"

namespace kiroku::apps {
namespace {

using archive::GapCause;
using archive::GapEntry;

std::vector<GapEntry> gaps(std::int64_t number) {
  std::vector<GapEntry> all;
  for (std::int64_t i = 0; i < number; ++i)
    all.push_back(
        {"room", {(10 * i + 12) * kSecond, (10 * i + 13) * kSecond + 500 * kMs}, GapCause::kSignalLost});
  return all;
}

TEST(StretchWords, NameTheGapsThatAnExportMeets) {
  EXPECT_EQ(gap_words({}, 0), "");
  EXPECT_EQ(gap_words(gaps(1), 2 * kSecond),
            "1 stated gap, 1.5 s in all: at 00:00:10 for 1.5 s (signal-lost)");
  EXPECT_EQ(gap_words(gaps(5), 0),
            "5 stated gaps, 7.5 s in all: at 00:00:12 for 1.5 s (signal-lost), at 00:00:22 for 1.5 s "
            "(signal-lost), at 00:00:32 for 1.5 s (signal-lost) and 2 more");
  EXPECT_EQ(gaps_within(gaps(5), {13 * kSecond, 32 * kSecond}).size(), 2U);
  EXPECT_EQ(gaps_json(gaps(1)).dump(),
            R"([{"start_ns":12000000000,"end_ns":13500000000,"cause":"signal-lost"}])");
}

TEST(StretchWords, SayThatTheClockWasSet) {
  const archive::Moment opened{*parse_utc("2026-08-05T09:15:02Z"), 0};
  EXPECT_EQ(clock_set_words(archive::WallClock(opened, {}), 0), "");
  const archive::WallClock set(opened, {{5 * kSecond, -3600 * kSecond}, {9 * kSecond, 15 * kMs}});
  EXPECT_EQ(
      clock_set_words(set, kSecond),
      "The recorder's clock was set in the course of the case, at 00:00:04 by -3600.000 s, at 00:00:08 by "
      "+0.015 s: times by it are as it showed them then. Time from the start of the case goes on "
      "evenly.\n");
  EXPECT_EQ(clock_set_json(set).dump(),
            R"([{"case_ns":5000000000,"step_ns":-3600000000000},{"case_ns":9000000000,"step_ns":15000000}])");
}

}  // namespace
}  // namespace kiroku::apps
