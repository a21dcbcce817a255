#include "trainer/statistics/signed_ranks.h"

#include <cmath>
#include <limits>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

// Hollander and Wolfe, Nonparametric Statistical Methods, 1973, page 29: Hamilton's depression scale of nine
// patients before and after a tranquilliser. T+ is 40; R's wilcox.test prints 0.01953 for one side.
TEST(SignedRanks, IsThatOfTheWorkedExample) {
  const std::vector<double> before{1.83, 0.50, 1.62, 2.48, 1.68, 1.88, 1.55, 3.06, 1.30},
      after{0.878, 0.647, 0.598, 2.05, 1.06, 1.29, 1.06, 3.14, 1.29};
  std::vector<double> differences;
  for (std::size_t i = 0; i < before.size(); ++i) differences.push_back(before[i] - after[i]);
  const SignedRanks found = signed_ranks(differences);
  EXPECT_EQ(found.differing, 9U);
  EXPECT_EQ(found.positive, 40);
  ASSERT_TRUE(found.p);
  EXPECT_NEAR(*found.p, 2 * 0.01953125, 1e-12);
}

/// By trying every choice of signs.
double by_trying(const std::vector<double>& ranks, double positive) {
  double all = 0;
  for (const double rank : ranks) all += rank;
  int extreme = 0;
  for (unsigned choice = 0; choice < 1U << ranks.size(); ++choice) {
    double sum = 0;
    for (std::size_t i = 0; i < ranks.size(); ++i) sum += (choice >> i & 1U) != 0 ? ranks[i] : 0;
    if (std::abs(sum - all / 2) >= std::abs(positive - all / 2) - 1e-9) ++extreme;
  }
  return extreme / std::exp2(ranks.size());
}

TEST(SignedRanks, IsExactWherePointsAreAlike) {
  // Sizes 1, 1, 1, 1, 2, 2, 3: their ranks are 2.5 four times, 5.5 twice, 7.
  const SignedRanks found = signed_ranks(std::vector<double>{1, 0, -1, 2, 1, 0, 1, 2, 3});
  EXPECT_EQ(found.pairs, 9U);
  EXPECT_EQ(found.differing, 7U);
  EXPECT_EQ(found.positive, 25.5);
  ASSERT_TRUE(found.p);
  EXPECT_NEAR(*found.p, by_trying({2.5, 2.5, 2.5, 2.5, 5.5, 5.5, 7}, 25.5), 1e-12);
}

TEST(SignedRanks, CannotBeSmallOfFewPairs) {
  EXPECT_NEAR(*signed_ranks(std::vector<double>{1, 2, 3, 4, 5}).p, 2 / 32.0, 1e-12);
  EXPECT_NEAR(*signed_ranks(std::vector<double>{1, 1, 1, 1, 1, 1}).p, 2 / 64.0, 1e-12);
  EXPECT_NEAR(*signed_ranks(std::vector<double>{-1, 1}).p, 1, 1e-12);
  // As many as no computer could try.
  const std::vector<double> many(200, 0.5);
  EXPECT_LT(*signed_ranks(many).p, 1e-50);
}

TEST(SignedRanks, TakesWhatRoundingLeftForAlike) {
  const SignedRanks found = signed_ranks(std::vector<double>{0.1 + 0.2 - 0.3, 0.1 + 0.2, 0.3});
  EXPECT_EQ(found.differing, 2U);
  EXPECT_EQ(found.positive, 3);
}

TEST(SignedRanks, SaysWhyThereIsNoTest) {
  EXPECT_EQ(signed_ranks({}).why_no_test, "there are no pairs");
  EXPECT_EQ(signed_ranks(std::vector<double>{0, 0, 0}).why_no_test, "no pair differs");
  EXPECT_THROW(signed_ranks(std::vector<double>{std::numeric_limits<double>::quiet_NaN()}), UsageError);
}

}  // namespace
}  // namespace kiroku::trainer
