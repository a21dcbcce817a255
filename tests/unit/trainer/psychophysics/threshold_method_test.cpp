#include "trainer/psychophysics/threshold_method.h"

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "trainer/haptic_rate/rate_subject.h"
#include "trainer/psychophysics/psychometric_function.h"
#include "trainer/psychophysics/rate_series.h"
#include "trainer/psychophysics/threshold_posterior.h"

namespace kiroku::trainer {
namespace {

constexpr RateSeries kBoth[] = {RateSeries::kHapticRate, RateSeries::kExclusion};

/// The papers round theirs.
void expect_published(RateSeries series, const std::vector<long>& hz) {
  for (std::size_t i = 1; i <= hz.size(); ++i) EXPECT_EQ(std::lround(rate_hz(series, i)), hz[i - 1]) << i;
}

TEST(RateSeries, OfHapticRateHasItsPublishedRates) {
  expect_published(RateSeries::kHapticRate, {100, 83, 56, 42, 33, 28, 24, 21, 19, 17, 15, 14});
  EXPECT_EQ(rates_of(RateSeries::kHapticRate), 750U);
  EXPECT_NEAR(rate_hz(RateSeries::kHapticRate, 750), 0.22222, 1e-5);
}

TEST(RateSeries, OfTheExclusionTrainerHasItsPublishedRates) {
  expect_published(RateSeries::kExclusion, {100, 77, 51, 38, 31, 26, 22, 19, 17, 15});
  EXPECT_EQ(rates_of(RateSeries::kExclusion), 250U);
  EXPECT_NEAR(rate_hz(RateSeries::kExclusion, 250), 0.61538, 1e-5);
}

TEST(RateSeries, FindsTheNearestRateOfItsOwn) {
  for (const RateSeries series : kBoth) {
    for (std::size_t i = 1; i <= rates_of(series); ++i)
      EXPECT_EQ(nearest_rate(series, rate_hz(series, i)), i) << name_of(series);
  }
  EXPECT_EQ(nearest_rate(RateSeries::kHapticRate, 9.06), 18U);
  EXPECT_EQ(nearest_rate(RateSeries::kExclusion, 9.06), 17U);
}

TEST(RateSeries, IsNamed) {
  for (const RateSeries series : kBoth) EXPECT_EQ(rate_series(name_of(series)), series);
  EXPECT_THROW(rate_series("papers"), UsageError);
}

TEST(PsychometricFunction, IsAHalfAtTheThresholdAndGuessesWhereItLapses) {
  const PsychometricFunction function{8.8, 0.1, 0.06};
  EXPECT_NEAR(function.vibrating(8.8), 0.5, 1e-12);
  EXPECT_NEAR(function.vibrating(0.6), 0.97, 1e-9);
  EXPECT_NEAR(function.vibrating(100), 0.03, 1e-9);
  // One spread below: Phi(1) = 0.841345.
  EXPECT_NEAR(function.vibrating(8.8 / std::pow(10, 0.1)), 0.03 + 0.94 * 0.841345, 1e-6);
}

/// The share of simulated subjects whose threshold is found within 10 %, and how many of the intervals hold
/// it.
struct Recovery {
  double within = 0, covered = 0, bias = 0;
};
Recovery recovery(MethodKind kind, std::size_t trials, double threshold_hz, int subjects,
                  RateSeries series = RateSeries::kHapticRate) {
  Recovery found;
  for (int subject = 0; subject < subjects; ++subject) {
    std::mt19937 random(static_cast<std::uint32_t>(1000 + subject));
    const PsychometricFunction function{threshold_hz, 0.08, 0.02};
    const auto method = make_method(kind, series);
    ThresholdPosterior posterior(series);
    for (std::size_t trial = 0; trial < trials; ++trial) {
      const std::size_t rate = method->next_rate();
      const bool vibrating = uniform(random) < function.vibrating(rate_hz(series, rate));
      method->answer(vibrating);
      posterior.add(rate, vibrating);
    }
    const ThresholdEstimate estimate = posterior.estimate();
    const double quotient = estimate.hz / threshold_hz;
    if (quotient > 0.9 && quotient < 1.1) found.within += 1.0 / subjects;
    if (estimate.interval_hz.low <= threshold_hz && estimate.interval_hz.high >= threshold_hz)
      found.covered += 1.0 / subjects;
    found.bias += std::log10(quotient) / subjects;
  }
  return found;
}

TEST(ThresholdMethod, TheBayesianOneFindsThresholdsWithinTenPercentInSixtyTrials) {
  for (const double threshold_hz : {23.3, 8.8, 3.0, 1.3, 1.2}) {
    const Recovery found = recovery(MethodKind::kBayesian, 60, threshold_hz, 200);
    const std::string name = "at_" + std::to_string(threshold_hz).substr(0, 4) + "_Hz";
    RecordProperty(name + "_within", std::to_string(found.within));
    RecordProperty(name + "_covered", std::to_string(found.covered));
    EXPECT_GE(found.within, 0.97) << threshold_hz;
    EXPECT_GE(found.covered, 0.9) << threshold_hz;
    EXPECT_LT(std::abs(found.bias), 0.01) << threshold_hz;
  }
}

TEST(ThresholdMethod, TheExclusionTrainersSeriesFindsThemToo) {
  for (const double threshold_hz : {21.3, 14.5, 6.6, 3.5}) {
    const Recovery found = recovery(MethodKind::kBayesian, 60, threshold_hz, 100, RateSeries::kExclusion);
    EXPECT_GE(found.within, 0.95) << threshold_hz;
    EXPECT_GE(found.covered, 0.9) << threshold_hz;
  }
}

TEST(ThresholdMethod, TheOthersFindThemToo) {
  for (const MethodKind kind : {MethodKind::kSearch, MethodKind::kStaircase}) {
    const Recovery found = recovery(kind, 60, 8.8, 200);
    RecordProperty(name_of(kind) + "_within", std::to_string(found.within));
    RecordProperty(name_of(kind) + "_covered", std::to_string(found.covered));
    EXPECT_GE(found.within, kind == MethodKind::kStaircase ? 0.9 : 0.7) << name_of(kind);
    EXPECT_GE(found.covered, 0.9) << name_of(kind);
  }
}

TEST(ThresholdMethod, WithoutDoubtTheSearchEndsBesideTheThreshold) {
  const auto ends_between = [](RateSeries series, std::size_t i) {
    const auto search = make_method(MethodKind::kSearch, series);
    int answers = 0;
    for (; !search->own_estimate_hz() && answers < 20; ++answers)
      search->answer(rate_hz(series, search->next_rate()) < 8.8);
    EXPECT_NEAR(search->own_estimate_hz().value_or(0), std::sqrt(rate_hz(series, i) * rate_hz(series, i + 1)),
                1e-12);
    return answers;
  };
  // 8.8 Hz is between i = 17 (9.05 Hz) and i = 18 (8.55 Hz); in the other series between 9.26 and 8.77 Hz.
  EXPECT_LE(ends_between(RateSeries::kExclusion, 17), 8);
  EXPECT_LE(ends_between(RateSeries::kHapticRate, 18), 10);
}

TEST(ThresholdMethod, TheStaircaseTurnsAroundTheThreshold) {
  for (const RateSeries series : kBoth) {
    const auto staircase = make_method(MethodKind::kStaircase, series);
    for (int trial = 0; trial < 30; ++trial) staircase->answer(rate_hz(series, staircase->next_rate()) < 3);
    ASSERT_TRUE(staircase->own_estimate_hz());
    EXPECT_NEAR(*staircase->own_estimate_hz(), 3, 0.2) << name_of(series);
  }
}

TEST(ThresholdMethod, StaysInTheSeriesWhateverIsAnswered) {
  for (const MethodKind kind : {MethodKind::kSearch, MethodKind::kStaircase, MethodKind::kBayesian}) {
    for (const bool answer : {true, false}) {
      const RateSeries series = answer ? RateSeries::kHapticRate : RateSeries::kExclusion;
      const auto method = make_method(kind, series);
      ThresholdPosterior posterior(series);
      for (int trial = 0; trial < 300; ++trial) {
        const std::size_t rate = method->next_rate();
        ASSERT_GE(rate, 1U);
        ASSERT_LE(rate, rates_of(series));
        method->answer(answer);
        posterior.add(rate, answer);
      }
      EXPECT_TRUE(std::isfinite(posterior.estimate().hz));
      EXPECT_LE(posterior.estimate().interval_hz.low, posterior.estimate().interval_hz.high);
    }
  }
}

TEST(ThresholdMethod, IsNamed) {
  for (const char* name : {"search", "staircase", "bayesian"}) EXPECT_EQ(name_of(method_kind(name)), name);
  EXPECT_THROW(method_kind("guess"), UsageError);
}

}  // namespace
}  // namespace kiroku::trainer
