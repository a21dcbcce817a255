#include "viewer/compare/time_map.h"

#include <cmath>
#include <random>

#include "base/error.h"
#include "tests/support/nanoseconds.h"

namespace kiroku::compare {
namespace {

using testing::HasSubstr;

const std::vector<PlannedStep> kStepsOfMap{{"a", 0, 2}, {"b", 2, 0}, {"c", 2, 4}};

StepMatch match(std::size_t step, double start_s, double end_s, std::vector<archive::Span> pauses = {}) {
  StepMatch match;
  match.step = step;
  match.span = {std::llround(start_s * 1e9), std::llround(end_s * 1e9)};
  match.pauses = std::move(pauses);
  match.end_from = KnownFrom::kHand;
  return match;
}

StepMatching matching_of(std::vector<StepMatch> matches) {
  return match_by_hand(kStepsOfMap, std::move(matches), 0);
}

TEST(TimeMap, RunsEvenlyWithinAStepAndStandsBetweenSteps) {
  // a twice as slow, 3 s of pause, b while the plan stands, c twice as fast.
  const TimeMap map(kStepsOfMap, matching_of({match(0, 10, 14), match(1, 17, 18), match(2, 18, 20)}));
  EXPECT_TRUE(map.monotone());
  EXPECT_DOUBLE_EQ(map.plan_at(11 * kSecond).plan_s, 0.5);
  EXPECT_FALSE(map.plan_at(11 * kSecond).stands);
  EXPECT_DOUBLE_EQ(map.plan_at(15 * kSecond).plan_s, 2);
  EXPECT_EQ(map.plan_at(15 * kSecond).step, 0U);
  EXPECT_TRUE(map.plan_at(15 * kSecond).stands);
  EXPECT_EQ(map.plan_at(17'500'000'000).step, 1U);
  EXPECT_DOUBLE_EQ(map.plan_at(17'500'000'000).plan_s, 2);
  EXPECT_DOUBLE_EQ(map.plan_at(19 * kSecond).plan_s, 4);
  EXPECT_TRUE(map.plan_at(0).stands);
  EXPECT_DOUBLE_EQ(map.plan_at(0).plan_s, 0);
  EXPECT_DOUBLE_EQ(map.plan_at(99 * kSecond).plan_s, 6);
  EXPECT_EQ(map.case_at(0, 0.5), 11 * kSecond);
  EXPECT_EQ(map.case_at(0, 2), 14 * kSecond);
  EXPECT_EQ(map.case_at(2, 2), 18 * kSecond);
  EXPECT_EQ(map.case_at(1, 2), 17 * kSecond);
  EXPECT_FALSE(map.case_at(0, 2.5).has_value());
}

TEST(TimeMap, KeepsAMapForEachStepWhereTheOrderChanged) {
  const TimeMap map(kStepsOfMap, matching_of({match(2, 1, 5), match(0, 6, 8)}));
  EXPECT_FALSE(map.monotone());
  EXPECT_DOUBLE_EQ(map.plan_at(3 * kSecond).plan_s, 4);
  EXPECT_DOUBLE_EQ(map.plan_at(7 * kSecond).plan_s, 1);
  EXPECT_EQ(map.case_at(2, 4), 3 * kSecond);
  EXPECT_EQ(map.case_at(0, 1), 7 * kSecond);
  EXPECT_FALSE(map.case_at(1, 2).has_value());
}

TEST(TimeMap, StandsWhileAStepIsInterrupted) {
  const TimeMap map(kStepsOfMap, matching_of({match(0, 0, 5, {{kSecond, 4 * kSecond}})}));
  EXPECT_DOUBLE_EQ(map.plan_at(500'000'000).plan_s, 0.5);
  EXPECT_DOUBLE_EQ(map.plan_at(2 * kSecond).plan_s, 1);
  EXPECT_TRUE(map.plan_at(2 * kSecond).stands);
  EXPECT_DOUBLE_EQ(map.plan_at(4'500'000'000).plan_s, 1.5);
  EXPECT_EQ(map.case_at(0, 1), kSecond);
  EXPECT_EQ(map.case_at(0, 1.5), 4'500'000'000);
}

TEST(TimeMap, GoesThroughPointsThatAPersonMatched) {
  const std::vector<Knot> points{{1.5, 2 * kSecond}};
  const TimeMap map(kStepsOfMap, matching_of({match(0, 0, 4)}), points);
  EXPECT_DOUBLE_EQ(map.plan_at(kSecond).plan_s, 0.75);
  EXPECT_DOUBLE_EQ(map.plan_at(3 * kSecond).plan_s, 1.75);
  const auto refusal = [&](const std::vector<Knot>& wrong) -> std::string {
    try {
      const TimeMap refused(kStepsOfMap, matching_of({match(0, 0, 4)}), wrong);
    } catch (const UsageError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal({{1.5, 5 * kSecond}}), HasSubstr("lies in no step"));
  EXPECT_THAT(refusal({{3, 2 * kSecond}}), HasSubstr("lies in no step"));
  EXPECT_THAT(refusal({{1.5, 2 * kSecond}, {1, 3 * kSecond}}), HasSubstr("not after the one before"));
}

TEST(TimeMap, IsItsOwnInverse) {
  std::mt19937 random(3);
  const TimeMap map(kStepsOfMap,
                    matching_of({match(2, 1, 9, {{3 * kSecond, 5 * kSecond}}), match(0, 12, 12.5)}));
  for (int i = 0; i < 1000; ++i) {
    const auto case_ns =
        static_cast<std::int64_t>(random() % 14) * kSecond + static_cast<std::int64_t>(random() % kSecond);
    const PlanMoment moment = map.plan_at(case_ns);
    if (moment.stands) continue;
    const auto back = map.case_at(moment.step, moment.plan_s);
    ASSERT_TRUE(back.has_value());
    EXPECT_NEAR(double(*back), double(case_ns), 100) << i;
  }
}

TEST(TimeMap, RefusesARecordingInWhichNothingWasFound) {
  EXPECT_THROW(TimeMap(kStepsOfMap, matching_of({})), Error);
  EXPECT_THROW(TimeMap(kStepsOfMap, matching_of({match(0, 3, 3)})), Error);
}

}  // namespace
}  // namespace kiroku::compare
