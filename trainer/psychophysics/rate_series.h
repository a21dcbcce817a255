// The rates at which forces are given. Pure, thread-safe.
#pragma once

#include <cmath>
#include <cstddef>

namespace kiroku::trainer {

/// Source: "Haptic Rate for Surgical Manipulations with Fingers and Instruments": r = 100 Hz for i = 1, and
/// 1 / (0.0065 i) Hz for 2 <= i < 250, down to 0.62 Hz.
inline constexpr std::size_t kMostRates = 249;
constexpr double rate_hz(std::size_t i) { return i == 1 ? 100 : 1 / (0.0065 * static_cast<double>(i)); }

/// Which i has the rate nearest to it, by their quotient.
inline std::size_t nearest_rate(double hz) {
  std::size_t best = 1;
  for (std::size_t i = 2; i <= kMostRates; ++i) {
    if (std::abs(std::log(rate_hz(i) / hz)) < std::abs(std::log(rate_hz(best) / hz))) best = i;
  }
  return best;
}

}  // namespace kiroku::trainer
