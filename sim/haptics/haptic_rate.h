// How often forces have to be renewed so that a hand takes them for continuous. Pure, thread-safe.
#pragma once

#include <array>
#include <cstddef>

namespace kiroku::sim {

struct HapticRateThreshold {
  std::size_t fingers;
  double rate_hz;  // below it, a hand that manipulates with so many fingers notices
};
/// Source: "Haptic Rate for Surgical Manipulations with Fingers and Instruments": the more fingers share a
/// manipulation, the lower the rate that suffices. They are what people noticed, not what a device needs to
/// be stable: a force loop runs at 1 kHz.
inline constexpr std::array<HapticRateThreshold, 5> kHapticRateThresholds{
    {{1, 23.3}, {2, 8.8}, {3, 3.0}, {4, 1.3}, {5, 1.2}}};

/// For so many fingers in contact; 0 for none, as nothing is felt. kiroku::UsageError for more than were
/// studied.
double haptic_rate_hz(std::size_t fingers);

}  // namespace kiroku::sim
