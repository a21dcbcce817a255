// Who answers in the haptic-rate experiment.
#pragma once

#include <cstdint>
#include <map>
#include <random>

#include "trainer/haptic_rate/plate.h"
#include "trainer/psychophysics/psychometric_function.h"

namespace kiroku::trainer {

/// A person at a device, or a model of one. Not thread-safe.
class RateSubject {
 public:
  virtual ~RateSubject() = default;
  /// Presses the plate with these fingers while forces are renewed at that rate. Does it vibrate?
  virtual bool feels_vibration(const Fingers& fingers, double rate_hz) = 0;
};

/// What hands felt while a finger was pressed up and down between kLeastPressN and kMostPressN.
struct FeltForces {
  double renewed_hz = 0;               // how often forces changed; 0 where they did not change twice
  double least_n = 0, greatest_n = 0;  // of a finger's, the mean of all fingers'
};

/// A simulated hand presses the plate in steps of the force loop (2 kHz, so that every rate of the series is
/// a whole number of steps), its forces renewed at `rate_hz` (HeldForces). Four renewals at least, and two
/// seconds. Time is the hand's own: nothing waits. The same call gives the same numbers.
FeltForces press_plate(const Plate& plate, const Fingers& fingers, double rate_hz);

using SubjectFunctions = std::map<Fingers, PsychometricFunction>;

/// Answers by a psychometric function of the rate it felt. The same seed gives the same answers. Its
/// threshold was put in: what comes out of it proves the estimator, and nothing about people.
class SimulatedSubject : public RateSubject {
 public:
  /// A function for each condition; the plate must outlive it. kiroku::UsageError for functions without
  /// sense.
  SimulatedSubject(const Plate& plate, SubjectFunctions functions, std::uint32_t seed);
  /// kiroku::UsageError for fingers without a function.
  bool feels_vibration(const Fingers& fingers, double rate_hz) override;

 private:
  const Plate& plate_;
  SubjectFunctions functions_;
  std::mt19937 random_;
};

/// 0 to 1 without 1, the same on every machine.
double uniform(std::mt19937& random);
/// Of mean 0 and standard deviation 1, within six of them.
double standard_normal(std::mt19937& random);

}  // namespace kiroku::trainer
