#include "trainer/statistics/power.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

// Source: Cohen, "A power primer", Psychological Bulletin 112, 1992, Table 2, and what G*Power 3 gives:
// small, medium and large effects, two-sided at 5 %, power 80 %.
TEST(Power, TakesAsManyPeopleAsPublishedTablesSay) {
  EXPECT_EQ(in_each_group_needed(0.2), 394U);
  EXPECT_EQ(in_each_group_needed(0.5), 64U);
  EXPECT_EQ(in_each_group_needed(0.8), 26U);
  EXPECT_EQ(pairs_needed(0.2), 199U);
  EXPECT_EQ(pairs_needed(0.5), 34U);
  EXPECT_EQ(pairs_needed(0.8), 15U);
  EXPECT_EQ(pairs_needed(-0.8), 15U);
}

TEST(Power, GrowsWithPeopleAndIsFivePercentWithoutAnEffect) {
  EXPECT_NEAR(power_of_pairs(0, 12), 0.05, 1e-9);
  EXPECT_NEAR(power_of_groups(0, 12), 0.05, 1e-9);
  double before = 0;
  for (std::size_t people = 2; people < 40; ++people) {
    EXPECT_GT(power_of_pairs(0.6, people), before);
    before = power_of_pairs(0.6, people);
    EXPECT_NEAR(before, power_of_pairs(-0.6, people), 1e-12);
  }
  EXPECT_EQ(power_of_pairs(1, 1), 0);
  EXPECT_EQ(power_of_groups(1, 0), 0);
}

TEST(Power, RefusesWhatNoNumberShows) {
  EXPECT_THROW((void)pairs_needed(0), UsageError);
  EXPECT_THROW((void)pairs_needed(std::numeric_limits<double>::quiet_NaN()), UsageError);
  EXPECT_THROW((void)in_each_group_needed(0.5, 1), UsageError);
  EXPECT_THROW((void)in_each_group_needed(0.5, 0.05), UsageError);
}

}  // namespace
}  // namespace kiroku::trainer
