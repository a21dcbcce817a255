// The rates at which forces are given. Pure, thread-safe.
#pragma once

#include <cmath>
#include <cstddef>
#include <string>

namespace kiroku::trainer {

/// The two studies each have a series of their own: 100 Hz for i = 1, and 1 / (step i) Hz from i = 2 on, so
/// that low rates lie close together.
enum class RateSeries { kHapticRate, kExclusion };

struct RateSteps {
  double step_s;
  std::size_t rates;  // i from 1
};
/// Source: "Haptic Rate for Surgical Manipulations with Fingers and Instruments": 750 rates, of which it
/// names 100, 83, 56, 42, 33, 28, 24, 21, 19, 17, 15 and 14 Hz. It gives no formula: 6 ms is the step that
/// has all of them. Down to 0.22 Hz.
inline constexpr RateSteps kHapticRateSeries{0.006, 750};
/// Source: "Construction of Training Environment for Surgical Exclusion with a Basic Study of Multi-finger
/// Haptic Interaction", Eq. 7: 250 rates, as its text says; the equation ends at i < 250. Down to 0.62 Hz.
inline constexpr RateSteps kExclusionSeries{0.0065, 250};

constexpr const RateSteps& steps_of(RateSeries series) {
  return series == RateSeries::kHapticRate ? kHapticRateSeries : kExclusionSeries;
}
constexpr std::size_t rates_of(RateSeries series) { return steps_of(series).rates; }
/// `i` from 1 to rates_of(series).
constexpr double rate_hz(RateSeries series, std::size_t i) {
  return i == 1 ? 100 : 1 / (steps_of(series).step_s * static_cast<double>(i));
}
/// Which i has the rate nearest to it, by their quotient.
std::size_t nearest_rate(RateSeries series, double hz);

/// "haptic-rate", "exclusion".
RateSeries rate_series(const std::string& name);  // kiroku::UsageError
std::string name_of(RateSeries series);

}  // namespace kiroku::trainer
