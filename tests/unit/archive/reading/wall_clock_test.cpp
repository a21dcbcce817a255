#include "archive/reading/wall_clock.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/nanoseconds.h"

namespace kiroku::archive {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

const UtcTime kClockOpened = *parse_utc("2026-08-05T09:15:02Z");

UtcTime shown_after(int seconds_of_clock) { return kClockOpened + std::chrono::seconds(seconds_of_clock); }

/// Opened at 2 s of the case clock; set at 12 s.
WallClock set_by(std::int64_t step_ns) {
  return WallClock({kClockOpened, 2 * kSecond}, {{5 * kSecond, 0}, {12 * kSecond, step_ns}});
}

TEST(WallClockOfACase, GoesOnFromTheOpening) {
  const WallClock clock({kClockOpened, 2 * kSecond}, {});
  EXPECT_EQ(clock.at(2 * kSecond), kClockOpened);
  EXPECT_EQ(clock.at(0), shown_after(-2)) << "what was recorded ahead";
  EXPECT_THAT(clock.case_times(shown_after(7)), ElementsAre(9 * kSecond));
  EXPECT_THAT(clock.steps(), IsEmpty());
}

TEST(WallClockOfACase, ThatIsSetForwardNeverShowsSomeTimes) {
  const WallClock clock = set_by(10 * kSecond);
  ASSERT_EQ(clock.steps().size(), 1U);
  EXPECT_EQ(clock.at(12 * kSecond - 1'000), shown_after(10) - std::chrono::microseconds(1));
  EXPECT_EQ(clock.at(12 * kSecond), shown_after(20));
  EXPECT_THAT(clock.case_times(shown_after(9)), ElementsAre(11 * kSecond));
  EXPECT_THAT(clock.case_times(shown_after(20)), ElementsAre(12 * kSecond));
  EXPECT_THAT(clock.case_times(shown_after(21)), ElementsAre(13 * kSecond));
  EXPECT_EQ(clock.step_over(shown_after(9)), nullptr);
  EXPECT_EQ(clock.step_over(shown_after(20)), nullptr);
  for (const int never : {10, 15, 19}) {
    EXPECT_THAT(clock.case_times(shown_after(never)), IsEmpty()) << never;
    EXPECT_EQ(clock.step_over(shown_after(never)), &clock.steps().front()) << never;
  }
  const auto [before, behind] = clock.around(clock.steps().front());
  EXPECT_EQ(before, shown_after(10));
  EXPECT_EQ(behind, shown_after(20));
}

TEST(WallClockOfACase, ThatIsSetBackShowsSomeTimesTwice) {
  const WallClock clock = set_by(-4 * kSecond);
  EXPECT_THAT(clock.case_times(shown_after(5)), ElementsAre(7 * kSecond));
  EXPECT_THAT(clock.case_times(shown_after(6)), ElementsAre(8 * kSecond, 12 * kSecond));
  EXPECT_THAT(clock.case_times(shown_after(9)), ElementsAre(11 * kSecond, 15 * kSecond));
  EXPECT_THAT(clock.case_times(shown_after(10)), ElementsAre(16 * kSecond));
  EXPECT_EQ(clock.step_over(shown_after(6)), nullptr);
}

// Whoever writes a ledger can state any of them.
TEST(WallClockOfACase, BearsStepsThatNoClockCanCount) {
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  constexpr std::int64_t kLeast = std::numeric_limits<std::int64_t>::min();
  const WallClock clock({kClockOpened, kMost}, {{1, kMost}, {2, kMost}, {3, kLeast}, {kMost, kLeast}});
  static_cast<void>(clock.at(0));
  static_cast<void>(clock.at(kMost));
  static_cast<void>(clock.case_times(kClockOpened));
  static_cast<void>(clock.step_over(kClockOpened));
}

}  // namespace
}  // namespace kiroku::archive
