// The simulated hand of the haptic-rate experiment: it presses the plate up and down. Not thread-safe.
#pragma once

#include <cstdint>

#include "trainer/haptic_rate/plate.h"

namespace kiroku::trainer {

/// Steps of the force loop: 2 kHz, so that every rate of both series is a whole number of steps.
inline constexpr double kForcePeriodSeconds = 5e-4;
/// How long a press takes, from kLeastPressN to kMostPressN and back: a cosine.
inline constexpr double kPressSeconds = 1.7;

/// How many steps a press is felt for: four renewals at least, and two seconds.
std::int64_t press_steps(double rate_hz);

struct PressingHand {
  /// The plate must outlive it.
  PressingHand(const Plate& plate, const Fingers& fingers);

  sim::SimulatedHand hand;
  PlateForces contact;
};

}  // namespace kiroku::trainer
