#include "trainer/statistics/comparison.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

using testing::HasSubstr;

// Hours of sleep gained by ten patients under two drugs: Student's own data ("The probable error of a mean",
// 1908), and what statistics packages find of them.
const std::vector<double> kFirstDrug{0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0};
const std::vector<double> kSecondDrug{1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4};

TEST(Comparison, OfPairsIsStudentsOwn) {
  const Comparison found = compare_pairs(kFirstDrug, kSecondDrug);
  ASSERT_TRUE(found.test);
  EXPECT_NEAR(found.difference, -1.58, 1e-12);
  EXPECT_NEAR(found.test->t, -4.0621, 5e-5);
  EXPECT_EQ(found.test->degrees_of_freedom, 9);
  EXPECT_NEAR(found.test->p, 0.002833, 5e-7);
  EXPECT_NEAR(found.test->of_difference.low, -2.4598858, 5e-8);
  EXPECT_NEAR(found.test->of_difference.high, -0.7001142, 5e-8);
}

TEST(Comparison, OfGroupsIsWelchs) {
  const Comparison found = compare_groups(kFirstDrug, kSecondDrug);
  ASSERT_TRUE(found.test);
  EXPECT_NEAR(found.test->t, -1.8608, 5e-5);
  EXPECT_NEAR(found.test->degrees_of_freedom, 17.776, 5e-4);
  EXPECT_NEAR(found.test->p, 0.07939, 5e-6);
  EXPECT_NEAR(found.test->of_difference.low, -3.3654832, 5e-8);
  EXPECT_NEAR(found.test->of_difference.high, 0.2054832, 5e-8);
  // d = -1.58 / 1.8986; times Hedges' factor of 18 degrees of freedom, nearly 1 - 3 / (4 * 18 - 1).
  EXPECT_NEAR(found.test->hedges_g, -0.8322 * (1 - 3.0 / 71), 2e-4);
}

TEST(Comparison, IntervalOfTheEffectEndsWhereTheTestTurns) {
  // The 95 % interval of the effect reaches zero exactly where Student's p is 0.05; with equal counts and
  // variances Welch's t is Student's.
  for (const double shift : {0.0, 0.5, 1.0, 1.5, 2.0, 3.0}) {
    const std::vector<double> first{1, 2, 3, 4, 5};
    std::vector<double> second;
    for (const double value : first) second.push_back(value + shift);
    const Comparison found = compare_groups(first, second);
    ASSERT_TRUE(found.test);
    EXPECT_EQ(found.test->of_hedges_g.high < 0, found.test->p < 0.05) << shift;
    EXPECT_LE(found.test->of_hedges_g.low, found.test->hedges_g);
    EXPECT_GE(found.test->of_hedges_g.high, found.test->hedges_g);
  }
}

TEST(Comparison, SaysWhyThereIsNoTest) {
  const std::vector<double> two{1, 2}, three{1, 2, 3}, same{4, 4, 4};
  EXPECT_FALSE(compare_groups(two, three).test);
  EXPECT_THAT(compare_groups(two, three).why_no_test, HasSubstr("at least 3 results in each group"));
  EXPECT_THAT(compare_groups(two, three).why_no_test, HasSubstr("2 and 3"));
  EXPECT_EQ(compare_groups(two, three).difference, -0.5);
  EXPECT_THAT(compare_groups(same, same).why_no_test, HasSubstr("the same"));
  EXPECT_THAT(compare_pairs(two, two).why_no_test, HasSubstr("at least 3 pairs"));
  EXPECT_THAT(compare_pairs(three, three).why_no_test, HasSubstr("differ by the same"));
}

TEST(Comparison, RefusesWhatIsNoResult) {
  const std::vector<double> none, one{1}, wrong{1, std::numeric_limits<double>::quiet_NaN()};
  EXPECT_THROW(summary_of(none), UsageError);
  EXPECT_THROW(compare_groups(wrong, one), UsageError);
  EXPECT_THROW(compare_pairs(one, none), UsageError);
}

TEST(Summary, OfAMeanHasStudentsInterval) {
  const SampleSummary found = summary_of(kFirstDrug);
  EXPECT_NEAR(found.mean, 0.75, 1e-12);
  EXPECT_NEAR(found.standard_deviation, 1.789010, 1e-6);
  ASSERT_TRUE(found.of_mean);
  // t of 9 degrees of freedom: 2.262157.
  EXPECT_NEAR(found.of_mean->high - found.mean, 2.262157 * 1.789010 / std::sqrt(10), 1e-6);
  EXPECT_FALSE(summary_of(std::vector<double>{3}).of_mean);
}

TEST(Summary, OfRatesHasAnIntervalAboveZero) {
  // Two values alone: Student's interval of their mean goes far below zero.
  const std::vector<double> two{1, 4};
  EXPECT_LT(summary_of(two).of_mean->low, 0);
  const GeometricSummary found = geometric_summary_of(two);
  EXPECT_EQ(found.count, 2U);
  EXPECT_NEAR(found.mean, 2, 1e-12);
  // t of one degree of freedom: 12.70620; the logarithms' standard error is log(2).
  ASSERT_TRUE(found.of_mean);
  EXPECT_NEAR(found.of_mean->high, 2 * std::pow(2, 12.70620), 1e-1);
  EXPECT_NEAR(found.of_mean->low * found.of_mean->high, 4, 1e-9);
  EXPECT_GT(found.of_mean->low, 0);
  EXPECT_FALSE(geometric_summary_of(std::vector<double>{3}).of_mean);
  EXPECT_THROW(geometric_summary_of(std::vector<double>{1, 0}), UsageError);
}

TEST(Holm, AdjustsFromTheLeastOn) {
  const std::vector<double> p{0.01, 0.04, 0.03, 0.005};
  EXPECT_THAT(holm_adjusted(p), testing::ElementsAre(testing::DoubleEq(0.03), testing::DoubleEq(0.06),
                                                     testing::DoubleEq(0.06), testing::DoubleEq(0.02)));
  EXPECT_THAT(holm_adjusted(std::vector<double>{0.8, 0.7}), testing::ElementsAre(1, 1));
  EXPECT_TRUE(holm_adjusted({}).empty());
}

}  // namespace
}  // namespace kiroku::trainer
