#include "archive/reading/wall_clock.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/nanoseconds.h"

namespace kiroku::archive {
namespace {

using std::chrono::seconds;
using testing::ElementsAre;
using testing::IsEmpty;

const UtcTime kOpened = *parse_utc("2026-08-05T09:15:02Z");

/// Opened at 2 s of the case clock; set at 12 s.
WallClock set_by(std::int64_t step_ns) {
  return WallClock({kOpened, 2 * kSecond}, {{5 * kSecond, 0}, {12 * kSecond, step_ns}});
}

TEST(WallClockOfACase, GoesOnFromTheOpening) {
  const WallClock clock({kOpened, 2 * kSecond}, {});
  EXPECT_EQ(clock.at(2 * kSecond), kOpened);
  EXPECT_EQ(clock.at(0), kOpened - seconds(2)) << "what was recorded ahead";
  EXPECT_THAT(clock.case_times(kOpened + seconds(7)), ElementsAre(9 * kSecond));
  EXPECT_THAT(clock.steps(), IsEmpty());
}

TEST(WallClockOfACase, ThatIsSetForwardNeverShowsSomeTimes) {
  const WallClock clock = set_by(10 * kSecond);
  ASSERT_EQ(clock.steps().size(), 1U);
  EXPECT_EQ(clock.at(12 * kSecond - 1'000), kOpened + seconds(10) - std::chrono::microseconds(1));
  EXPECT_EQ(clock.at(12 * kSecond), kOpened + seconds(20));
  EXPECT_THAT(clock.case_times(kOpened + seconds(9)), ElementsAre(11 * kSecond));
  EXPECT_THAT(clock.case_times(kOpened + seconds(20)), ElementsAre(12 * kSecond));
  EXPECT_THAT(clock.case_times(kOpened + seconds(21)), ElementsAre(13 * kSecond));
  EXPECT_EQ(clock.step_over(kOpened + seconds(9)), nullptr);
  EXPECT_EQ(clock.step_over(kOpened + seconds(20)), nullptr);
  for (const int never : {10, 15, 19}) {
    EXPECT_THAT(clock.case_times(kOpened + seconds(never)), IsEmpty()) << never;
    EXPECT_EQ(clock.step_over(kOpened + seconds(never)), &clock.steps().front()) << never;
  }
  const auto [before, behind] = clock.around(clock.steps().front());
  EXPECT_EQ(before, kOpened + seconds(10));
  EXPECT_EQ(behind, kOpened + seconds(20));
}

TEST(WallClockOfACase, ThatIsSetBackShowsSomeTimesTwice) {
  const WallClock clock = set_by(-4 * kSecond);
  EXPECT_THAT(clock.case_times(kOpened + seconds(5)), ElementsAre(7 * kSecond));
  EXPECT_THAT(clock.case_times(kOpened + seconds(6)), ElementsAre(8 * kSecond, 12 * kSecond));
  EXPECT_THAT(clock.case_times(kOpened + seconds(9)), ElementsAre(11 * kSecond, 15 * kSecond));
  EXPECT_THAT(clock.case_times(kOpened + seconds(10)), ElementsAre(16 * kSecond));
  EXPECT_EQ(clock.step_over(kOpened + seconds(6)), nullptr);
}

// Whoever writes a ledger can state any of them.
TEST(WallClockOfACase, BearsStepsThatNoClockCanCount) {
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  constexpr std::int64_t kLeast = std::numeric_limits<std::int64_t>::min();
  const WallClock clock({kOpened, kMost}, {{1, kMost}, {2, kMost}, {3, kLeast}, {kMost, kLeast}});
  static_cast<void>(clock.at(0));
  static_cast<void>(clock.at(kMost));
  static_cast<void>(clock.case_times(kOpened));
  static_cast<void>(clock.step_over(kOpened));
}

}  // namespace
}  // namespace kiroku::archive
