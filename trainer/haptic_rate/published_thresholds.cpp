#include "trainer/haptic_rate/published_thresholds.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "sim/haptics/haptic_rate.h"

namespace kiroku::trainer {
namespace {

/// All values of several samples together, of which only these are known; `of_mean` stays absent.
SampleSummary pooled(const std::vector<PublishedThreshold>& conditions, std::size_t values_of_each) {
  const auto count = static_cast<double>(values_of_each);
  SampleSummary all;
  all.count = values_of_each * conditions.size();
  for (const PublishedThreshold& one : conditions)
    all.mean += one.mean_hz / static_cast<double>(conditions.size());
  double squares = 0;
  for (const PublishedThreshold& one : conditions) {
    const double off = one.mean_hz - all.mean;
    squares += (count - 1) * *one.sd_hz * *one.sd_hz + count * off * off;
  }
  all.standard_deviation = std::sqrt(squares / (static_cast<double>(all.count) - 1));
  return all;
}

}  // namespace

std::vector<PublishedThreshold> published_thresholds(RateSeries series) {
  std::vector<PublishedThreshold> found;
  if (series == RateSeries::kHapticRate) {
    for (const sim::HapticRateThreshold& one : sim::kHapticRateThresholds)
      found.push_back({one.fingers, one.rate_hz, std::nullopt});
    return found;
  }
  return {{Fingers({Finger::kIndex}), 21.3, 35.0},
          {Fingers({Finger::kMiddle}), 14.5, 25.8},
          {Fingers({Finger::kThird}), 20.8, 33.0},
          {Fingers({Finger::kLittle}), 6.6, 24.9},
          {Fingers({Finger::kIndex, Finger::kMiddle}), 4.9, 11.2},
          {Fingers({Finger::kMiddle, Finger::kThird}), 3.5, 9.8}};
}

std::optional<double> published_threshold_hz(RateSeries series, const Fingers& fingers) {
  for (const PublishedThreshold& one : published_thresholds(series)) {
    if (one.fingers == fingers) return one.mean_hz;
  }
  constexpr std::array<double, 2> kExclusionHz{15.8, 4.2};
  if (series != RateSeries::kExclusion || fingers.named() || fingers.count() > kExclusionHz.size())
    return std::nullopt;
  return kExclusionHz.at(fingers.count() - 1);
}

std::size_t values_needed(double mean, double standard_deviation, double least) {
  const double ratio = standard_deviation / (mean - least);
  return std::max<std::size_t>(2, static_cast<std::size_t>(std::ceil(ratio * ratio)));
}

std::optional<std::size_t> values_allowed(double mean, double standard_deviation, double least, double most) {
  const double widest = (mean - least) * (most - mean);
  const double variance = standard_deviation * standard_deviation;
  if (variance <= widest) return std::nullopt;
  // n / (n - 1) has to be at least variance / widest.
  return static_cast<std::size_t>(std::floor(variance / (variance - widest)));
}

Comparison single_and_several_of_table_1(std::size_t values_of_each) {
  std::vector<PublishedThreshold> single, several;
  for (const PublishedThreshold& one : published_thresholds(RateSeries::kExclusion))
    (one.fingers.count() == 1 ? single : several).push_back(one);
  return compare_summaries(pooled(single, values_of_each), pooled(several, values_of_each));
}

LogNormal log_normal(double mean, double standard_deviation) {
  const double ratio = standard_deviation / mean;
  const double variance = std::log1p(ratio * ratio);
  return {std::log(mean) - variance / 2, std::sqrt(variance)};
}

double effect_between(const PublishedThreshold& first, const PublishedThreshold& second) {
  if (!first.sd_hz || !second.sd_hz)
    throw UsageError("an effect is measured in standard deviations, and one of these has none");
  const LogNormal a = log_normal(first.mean_hz, *first.sd_hz), b = log_normal(second.mean_hz, *second.sd_hz);
  return (a.location - b.location) / std::hypot(a.spread, b.spread);
}

}  // namespace kiroku::trainer
