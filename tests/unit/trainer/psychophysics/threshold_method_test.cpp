#include "trainer/psychophysics/threshold_method.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "base/error.h"
#include "trainer/haptic_rate/rate_subject.h"
#include "trainer/psychophysics/psychometric_function.h"
#include "trainer/psychophysics/rate_series.h"
#include "trainer/psychophysics/threshold_posterior.h"

namespace kiroku::trainer {
namespace {

TEST(RateSeries, IsThePapers) {
  EXPECT_EQ(rate_hz(1), 100);
  EXPECT_NEAR(rate_hz(2), 76.923, 1e-3);
  EXPECT_NEAR(rate_hz(249), 0.61785, 1e-5);
  for (std::size_t i = 1; i <= kMostRates; ++i) EXPECT_EQ(nearest_rate(rate_hz(i)), i);
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
Recovery recovery(MethodKind kind, std::size_t trials, double threshold_hz, int subjects) {
  Recovery found;
  for (int subject = 0; subject < subjects; ++subject) {
    std::mt19937 random(static_cast<std::uint32_t>(1000 + subject));
    const PsychometricFunction function{threshold_hz, 0.08, 0.02};
    const auto method = make_method(kind);
    ThresholdPosterior posterior;
    for (std::size_t trial = 0; trial < trials; ++trial) {
      const std::size_t rate = method->next_rate();
      const bool vibrating = uniform(random) < function.vibrating(rate_hz(rate));
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
  const auto search = make_method(MethodKind::kSearch);
  for (int trial = 0; trial < 8; ++trial) {
    EXPECT_FALSE(search->own_estimate_hz());
    search->answer(rate_hz(search->next_rate()) < 8.8);
  }
  // 8.8 Hz is between i = 17 (9.05 Hz) and i = 18 (8.55 Hz).
  ASSERT_TRUE(search->own_estimate_hz());
  EXPECT_NEAR(*search->own_estimate_hz(), std::sqrt(rate_hz(17) * rate_hz(18)), 1e-12);
}

TEST(ThresholdMethod, TheStaircaseTurnsAroundTheThreshold) {
  const auto staircase = make_method(MethodKind::kStaircase);
  for (int trial = 0; trial < 30; ++trial) staircase->answer(rate_hz(staircase->next_rate()) < 3);
  ASSERT_TRUE(staircase->own_estimate_hz());
  EXPECT_NEAR(*staircase->own_estimate_hz(), 3, 0.2);
}

TEST(ThresholdMethod, StaysInTheSeriesWhateverIsAnswered) {
  for (const MethodKind kind : {MethodKind::kSearch, MethodKind::kStaircase, MethodKind::kBayesian}) {
    for (const bool answer : {true, false}) {
      const auto method = make_method(kind);
      ThresholdPosterior posterior;
      for (int trial = 0; trial < 300; ++trial) {
        const std::size_t rate = method->next_rate();
        ASSERT_GE(rate, 1U);
        ASSERT_LE(rate, kMostRates);
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
