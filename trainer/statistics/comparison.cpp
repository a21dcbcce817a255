#include "trainer/statistics/comparison.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/non_central_t.hpp>
#include <boost/math/distributions/students_t.hpp>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

constexpr double kTail = (1 - kConfidence) / 2;

double two_sided_p(double t, double degrees_of_freedom) {
  const boost::math::students_t_distribution<double> distribution(degrees_of_freedom);
  return 2 * boost::math::cdf(boost::math::complement(distribution, std::abs(t)));
}

double critical_t(double degrees_of_freedom) {
  const boost::math::students_t_distribution<double> distribution(degrees_of_freedom);
  return boost::math::quantile(boost::math::complement(distribution, kTail));
}

/// The noncentrality at which t or less has that probability. The probability falls with it.
double noncentrality(double t, double degrees_of_freedom, double probability) {
  // Far out, where Boost's series does not reach, t is the noncentrality over the root of chi squared /
  // degrees of freedom.
  constexpr double kFar = 3e4;
  if (std::abs(t) > kFar) {
    const boost::math::chi_squared_distribution<double> distribution(degrees_of_freedom);
    return t * std::sqrt(boost::math::quantile(distribution, t > 0 ? 1 - probability : probability) /
                         degrees_of_freedom);
  }
  const auto of = [&](double centre) {
    return boost::math::cdf(boost::math::non_central_t_distribution<double>(degrees_of_freedom, centre), t);
  };
  double low = t - 1, high = t + 1;
  for (double reach = 1; of(low) < probability; reach *= 2) low -= reach;
  for (double reach = 1; of(high) > probability; reach *= 2) high += reach;
  constexpr int kHalvings = 60;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = (low + high) / 2;
    (of(middle) > probability ? low : high) = middle;
  }
  return (low + high) / 2;
}

/// Hedges' factor, as his gamma functions: what takes the bias from a standardised difference.
double without_bias(double degrees_of_freedom) {
  return std::exp(std::lgamma(degrees_of_freedom / 2) - std::lgamma((degrees_of_freedom - 1) / 2)) /
         std::sqrt(degrees_of_freedom / 2);
}

/// `t_pooled` and the degrees of freedom of the standard deviation that the difference is measured by; one
/// standard deviation of difference is `scale` of t.
void add_effect(TestResult& test, double t_pooled, double degrees_of_freedom, double scale) {
  const double factor = without_bias(degrees_of_freedom) * scale;
  test.hedges_g = factor * t_pooled;
  test.of_hedges_g = {factor * noncentrality(t_pooled, degrees_of_freedom, 1 - kTail),
                      factor * noncentrality(t_pooled, degrees_of_freedom, kTail)};
}

std::string too_few(const std::string& counts, const std::string& what) {
  return "a test needs at least " + std::to_string(kLeastForTest) + " " + what + ", and there are " + counts;
}

}  // namespace

SampleSummary summary_of(std::span<const double> values) {
  if (values.empty()) throw UsageError("there is nothing to summarise: no result was given");
  if (!std::ranges::all_of(values, [](double value) { return std::isfinite(value); }))
    throw UsageError("a result is no finite number");
  SampleSummary found;
  found.count = values.size();
  const auto count = static_cast<double>(values.size());
  found.mean = std::accumulate(values.begin(), values.end(), 0.0) / count;
  if (values.size() < 2) return found;
  if (std::ranges::all_of(values, [&](double value) { return value == values[0]; })) {
    found.mean = values[0];  // not what rounding makes of the sum
  }
  double squares = 0;
  for (const double value : values) squares += (value - found.mean) * (value - found.mean);
  found.standard_deviation = std::sqrt(squares / (count - 1));
  const double reach = critical_t(count - 1) * found.standard_deviation / std::sqrt(count);
  found.of_mean = Interval{found.mean - reach, found.mean + reach};
  return found;
}

GeometricSummary geometric_summary_of(std::span<const double> values) {
  std::vector<double> logarithms;
  for (const double value : values) {
    if (!(value > 0)) throw UsageError("values of a geometric mean must be above zero");
    logarithms.push_back(std::log(value));
  }
  const SampleSummary of_logarithms = summary_of(logarithms);
  GeometricSummary found{of_logarithms.count, std::exp(of_logarithms.mean), {}};
  if (of_logarithms.of_mean)
    found.of_mean = Interval{std::exp(of_logarithms.of_mean->low), std::exp(of_logarithms.of_mean->high)};
  return found;
}

Comparison compare_pairs(std::span<const double> first, std::span<const double> second) {
  if (first.size() != second.size())
    throw UsageError("pairs need as many first as second results, not " + std::to_string(first.size()) +
                     " and " + std::to_string(second.size()));
  std::vector<double> differences(first.size());
  std::ranges::transform(first, second, differences.begin(), std::minus());
  const SampleSummary summary = summary_of(differences);
  Comparison found;
  found.difference = summary.mean;
  if (summary.count < kLeastForTest) {
    found.why_no_test = too_few(std::to_string(summary.count), "pairs");
  } else if (summary.standard_deviation == 0) {
    found.why_no_test = "all pairs differ by the same, so that nothing tells how much chance there is";
  } else {
    const auto count = static_cast<double>(summary.count);
    TestResult test;
    test.degrees_of_freedom = count - 1;
    test.t = summary.mean / (summary.standard_deviation / std::sqrt(count));
    test.p = two_sided_p(test.t, test.degrees_of_freedom);
    test.of_difference = *summary.of_mean;
    add_effect(test, test.t, count - 1, 1 / std::sqrt(count));
    found.test = test;
  }
  return found;
}

Comparison compare_groups(std::span<const double> first, std::span<const double> second) {
  return compare_summaries(summary_of(first), summary_of(second));
}

Comparison compare_summaries(const SampleSummary& a, const SampleSummary& b) {
  Comparison found;
  found.difference = a.mean - b.mean;
  if (std::min(a.count, b.count) < kLeastForTest) {
    found.why_no_test =
        too_few(std::to_string(a.count) + " and " + std::to_string(b.count), "results in each group");
    return found;
  }
  const auto n_a = static_cast<double>(a.count), n_b = static_cast<double>(b.count);
  const double variance_a = a.standard_deviation * a.standard_deviation,
               variance_b = b.standard_deviation * b.standard_deviation;
  const double of_mean_a = variance_a / n_a, of_mean_b = variance_b / n_b;
  if (of_mean_a + of_mean_b == 0) {
    found.why_no_test = "all results of a group are the same, so that nothing tells how much chance there is";
    return found;
  }
  TestResult test;
  const double error = std::sqrt(of_mean_a + of_mean_b);
  test.t = found.difference / error;
  test.degrees_of_freedom = (of_mean_a + of_mean_b) * (of_mean_a + of_mean_b) /
                            (of_mean_a * of_mean_a / (n_a - 1) + of_mean_b * of_mean_b / (n_b - 1));
  test.p = two_sided_p(test.t, test.degrees_of_freedom);
  const double reach = critical_t(test.degrees_of_freedom) * error;
  test.of_difference = {found.difference - reach, found.difference + reach};
  const double pooled = std::sqrt(((n_a - 1) * variance_a + (n_b - 1) * variance_b) / (n_a + n_b - 2));
  const double scale = std::sqrt(1 / n_a + 1 / n_b);
  add_effect(test, found.difference / (pooled * scale), n_a + n_b - 2, scale);
  found.test = test;
  return found;
}

std::vector<double> holm_adjusted(std::span<const double> p) {
  std::vector<std::size_t> order(p.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return p[i]; });
  std::vector<double> adjusted(p.size());
  double largest = 0;
  for (std::size_t rank = 0; rank < order.size(); ++rank) {
    largest = std::max(largest, std::min(1.0, static_cast<double>(p.size() - rank) * p[order[rank]]));
    adjusted[order[rank]] = largest;
  }
  return adjusted;
}

}  // namespace kiroku::trainer
