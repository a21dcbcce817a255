#include "trainer/haptic_rate/published_thresholds.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "trainer/statistics/power.h"

namespace kiroku::trainer {
namespace {

TEST(PublishedThresholds, TheMeansOfTheTextAreThoseOfTheTable) {
  double single = 0, several = 0;
  for (const PublishedThreshold& one : published_thresholds(RateSeries::kExclusion))
    (one.fingers.count() == 1 ? single : several) += one.mean_hz / (one.fingers.count() == 1 ? 4 : 2);
  EXPECT_NEAR(single, *published_threshold_hz(RateSeries::kExclusion, 1), 0.051);
  EXPECT_NEAR(several, *published_threshold_hz(RateSeries::kExclusion, 2), 0.051);
}

TEST(PublishedThresholds, SoManyValuesAreNeededAsTheExtremesHave) {
  // One value away from all others has the largest spread that n values of that mean can have.
  for (const std::size_t n : {3U, 6U, 20U}) {
    std::vector<double> values(n, 2.0);
    values[0] = 90;
    const SampleSummary extreme = summary_of(values);
    EXPECT_EQ(values_needed(extreme.mean, extreme.standard_deviation * (1 - 1e-9), 2), n);
    EXPECT_EQ(values_needed(extreme.mean, extreme.standard_deviation * (1 + 1e-9), 2), n + 1);
    // And with both ends, so many at most: more of them have a lesser spread.
    EXPECT_EQ(values_allowed(extreme.mean, extreme.standard_deviation * (1 - 1e-9), 2, 90), n);
    EXPECT_EQ(values_allowed(extreme.mean, extreme.standard_deviation * (1 + 1e-9), 2, 90), n - 1);
  }
  EXPECT_FALSE(values_allowed(10, 1, 0, 100));
}

TEST(PublishedThresholds, SpreadsOfTable1AreNotOfOneThresholdAPerson) {
  std::size_t too_wide = 0;
  for (const PublishedThreshold& one : published_thresholds(RateSeries::kExclusion)) {
    const std::size_t needed = values_needed(one.mean_hz, *one.sd_hz);
    RecordProperty("values_" + one.fingers.text(), static_cast<int>(needed));
    if (needed > kPublishedSubjects) ++too_wide;
  }
  EXPECT_EQ(too_wide, 2U);  // the little finger, and middle and third
  // No number of rates of the series has the mean and the spread of the little finger.
  const double lowest = rate_hz(RateSeries::kExclusion, rates_of(RateSeries::kExclusion));
  EXPECT_GT(values_needed(6.6, 24.9, lowest), values_allowed(6.6, 24.9, lowest, 100).value());
}

TEST(PublishedThresholds, SixValuesEachDoNotGiveThePublishedP) {
  const Comparison six = single_and_several_of_table_1(kPublishedSubjects);
  EXPECT_NEAR(six.difference, 15.8 - 4.2, 1e-9);
  EXPECT_GT(six.test->p, 0.05);
  RecordProperty("p_of_six", std::to_string(six.test->p));
  double before = 1;
  for (std::size_t values = 3; values < 40; ++values) {
    const double p = single_and_several_of_table_1(values).test->p;
    EXPECT_LT(p, before);
    if (before > kPublishedP && p <= kPublishedP) RecordProperty("values_each", static_cast<int>(values));
    before = p;
  }
  EXPECT_LT(before, kPublishedP);
}

TEST(PublishedThresholds, ALogNormalPopulationHasItsMeanAndSpread) {
  // By its moments: E exp(k x) = exp(k m + k^2 s^2 / 2).
  const LogNormal found = log_normal(21.3, 35.0);
  const double mean = std::exp(found.location + found.spread * found.spread / 2);
  const double square = std::exp(2 * found.location + 2 * found.spread * found.spread);
  EXPECT_NEAR(mean, 21.3, 1e-9);
  EXPECT_NEAR(std::sqrt(square - mean * mean), 35.0, 1e-9);
  EXPECT_THROW((void)effect_between({1, 23.3, std::nullopt}, {2, 8.8, 3.0}), UsageError);
  EXPECT_NEAR(effect_between({1, 5, 2.0}, {2, 5, 2.0}), 0, 1e-12);
  EXPECT_GT(effect_between({1, 9, 2.0}, {2, 5, 2.0}), 1);
}

TEST(PublishedThresholds, APowerAnalysisSaysHowManyPeopleItTakes) {
  const std::vector<PublishedThreshold> table = published_thresholds(RateSeries::kExclusion);
  const auto people = [&](std::size_t i, std::size_t j) {
    return pairs_needed(effect_between(table[i], table[j]));
  };
  RecordProperty("index_and_index+middle", static_cast<int>(people(0, 4)));
  RecordProperty("index_and_middle", static_cast<int>(people(0, 1)));
  RecordProperty("index_and_little", static_cast<int>(people(0, 3)));
  // One finger and two are told apart by fewer people than two single fingers; six do for neither.
  EXPECT_GT(people(0, 4), kPublishedSubjects);
  EXPECT_GT(people(0, 1), 5 * people(0, 4));
}

}  // namespace
}  // namespace kiroku::trainer
