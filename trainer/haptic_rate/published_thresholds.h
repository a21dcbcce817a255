// The thresholds that the two studies published, and what can be concluded from their means and standard
// deviations alone. Pure functions, thread-safe.
#pragma once

#include <optional>
#include <vector>

#include "trainer/haptic_rate/fingers.h"
#include "trainer/psychophysics/rate_series.h"
#include "trainer/statistics/comparison.h"

namespace kiroku::trainer {

struct PublishedThreshold {
  Fingers fingers = 1;
  double mean_hz = 0;
  std::optional<double> sd_hz;  // the haptic-rate study tells none
};

/// Source: of RateSeries::kHapticRate sim::kHapticRateThresholds, one to five fingers; of kExclusion Table 1
/// of "Construction of Training Environment for Surgical Exclusion with a Basic Study of Multi-finger Haptic
/// Interaction": four fingers and two pairs, named.
std::vector<PublishedThreshold> published_thresholds(RateSeries series);

/// The mean that the study published for that condition; none where it has none. The exclusion study also has
/// means over its single fingers and over its pairs (section 6.1), as conditions 1 and 2.
std::optional<double> published_threshold_hz(RateSeries series, const Fingers& fingers);

/// Of Table 1, one finger against two.
inline constexpr double kPublishedP = 0.021;
inline constexpr std::size_t kPublishedSubjects = 6;

/// How many values above `least_hz` it takes for that mean and standard deviation: with fewer none of them
/// could be far enough from the mean. For values of at least `least`, the squares around their mean add up to
/// at most n (n - 1) (mean - least)^2, which all of the sum in one value has.
std::size_t values_needed(double mean, double standard_deviation, double least = 0);
/// How many values at most, between `least` and `most`: the squares around the mean add up to at most
/// n (mean - least) (most - mean), which values at both ends have. None: any number.
std::optional<std::size_t> values_allowed(double mean, double standard_deviation, double least, double most);

/// Table 1's four single fingers against its two pairs by Welch's t, from its means and standard deviations,
/// had each been of so many values.
Comparison single_and_several_of_table_1(std::size_t values_of_each);

/// Of the logarithm of values above zero, natural.
struct LogNormal {
  double location = 0, spread = 1;
};
/// That of which mean and standard deviation are these.
LogNormal log_normal(double mean, double standard_deviation);

/// The difference of the logarithms of two conditions, in standard deviations of the difference, for
/// log-normal populations with these means and standard deviations that say nothing about each other: what a
/// study of pairs would look for. Both need a standard deviation: kiroku::UsageError.
double effect_between(const PublishedThreshold& first, const PublishedThreshold& second);

}  // namespace kiroku::trainer
