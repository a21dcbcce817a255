// Are two sets of results different, and by how much? Student's t for pairs, Welch's t for two groups, effect
// sizes with intervals, and p-values of several questions together. Pure functions, thread-safe. The
// distributions are Boost.Math's.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace kiroku::trainer {

inline constexpr double kConfidence = 0.95;
/// Of each group. With fewer the spread is hardly known, and a p-value would say more than the results do.
inline constexpr std::size_t kLeastForTest = 3;

struct Interval {
  double low = 0, high = 0;
};

struct SampleSummary {
  std::size_t count = 0;
  double mean = 0;
  double standard_deviation = 0;    // with n - 1; 0 for a single value
  std::optional<Interval> of_mean;  // its 95 % interval by Student's t; absent for fewer than two values
};
/// kiroku::UsageError for no values and values that are not finite.
SampleSummary summary_of(std::span<const double> values);

/// Of numbers above zero whose spread is a share of them, as thresholds' is: on the scale of their
/// logarithms, so that no end of an interval is below zero.
struct GeometricSummary {
  std::size_t count = 0;
  double mean = 0;                  // the geometric one
  std::optional<Interval> of_mean;  // its 95 % interval by Student's t; absent for fewer than two values
};
/// kiroku::UsageError for no values and values that are not above zero and finite.
GeometricSummary geometric_summary_of(std::span<const double> values);

struct TestResult {
  double t = 0, degrees_of_freedom = 0;
  double p = 1;  // two-sided
  /// 95 % interval of the difference of means.
  Interval of_difference;
  /// The difference in standard deviations, without the bias of small samples, and its 95 % interval by the
  /// noncentral t distribution (Steiger and Fouladi, 1997).
  double hedges_g = 0;
  Interval of_hedges_g;
};
struct Comparison {
  double difference = 0;  // mean of the first less that of the second
  std::optional<TestResult> test;
  std::string why_no_test;  // a sentence, where there is none
};

/// Student's t of first[i] - second[i]; Hedges' g by the standard deviation of the differences.
/// kiroku::UsageError where they are not as many, none, or not finite.
Comparison compare_pairs(std::span<const double> first, std::span<const double> second);

/// Welch's t: variances need not be equal (Welch, 1947); Hedges' g by the pooled standard deviation.
/// kiroku::UsageError as summary_of().
Comparison compare_groups(std::span<const double> first, std::span<const double> second);

/// The same of what a paper tells of two groups: counts, means and standard deviations (`of_mean` is not
/// read).
Comparison compare_summaries(const SampleSummary& first, const SampleSummary& second);

/// p-values of a family of tests, so that the chance to call any difference real that is none stays what one
/// test's is (Holm, 1979); in the order given.
std::vector<double> holm_adjusted(std::span<const double> p);

}  // namespace kiroku::trainer
