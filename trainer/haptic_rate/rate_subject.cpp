#include "trainer/haptic_rate/rate_subject.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <boost/math/distributions/normal.hpp>

#include "base/error.h"
#include "trainer/haptic_rate/held_forces.h"
#include "trainer/haptic_rate/pressing_hand.h"

namespace kiroku::trainer {

using sim::Vector3;

double uniform(std::mt19937& random) { return static_cast<double>(random()) / 4294967296.0; }

double standard_normal(std::mt19937& random) {
  return boost::math::quantile(boost::math::normal(), std::clamp(uniform(random), 1e-9, 1 - 1e-9));
}

FeltForces press_plate(const Plate& plate, const Fingers& fingers, double rate_hz) {
  PressingHand pressing(plate, fingers);
  HeldForces held(pressing.contact, rate_hz);
  const std::size_t count = fingers.count();
  std::vector<sim::Pose> poses(count);
  std::vector<Vector3> forces_n(count), before_n(count);
  const std::int64_t steps = press_steps(rate_hz);
  FeltForces felt{0, std::numeric_limits<double>::infinity(), 0};
  std::int64_t first = -1, last = -1, changes = 0;
  for (std::int64_t step = 0; step <= steps; ++step) {
    pressing.hand.read(poses);
    held.forces(poses, kForcePeriodSeconds, forces_n);
    pressing.hand.write(forces_n);
    if (step > 0 && forces_n != before_n) {
      if (first < 0) first = step;
      last = step;
      ++changes;
    }
    before_n = forces_n;
    double mean_n = 0;
    for (const Vector3& force_n : forces_n) mean_n += force_n.norm() / static_cast<double>(count);
    felt.least_n = std::min(felt.least_n, mean_n);
    felt.greatest_n = std::max(felt.greatest_n, mean_n);
  }
  if (changes > 1)
    felt.renewed_hz =
        static_cast<double>(changes - 1) / (static_cast<double>(last - first) * kForcePeriodSeconds);
  return felt;
}

SimulatedSubject::SimulatedSubject(const Plate& plate, SubjectFunctions functions, std::uint32_t seed)
    : plate_(plate), functions_(std::move(functions)), random_(seed) {
  for (const auto& [fingers, function] : functions_) {
    if (!(function.threshold_hz > 0) || !(function.spread > 0) || !std::isfinite(function.threshold_hz) ||
        !std::isfinite(function.spread) || !(function.lapse_rate >= 0 && function.lapse_rate < 1)) {
      throw UsageError(
          "a simulated subject needs a threshold and a spread greater than zero, and a lapse rate below 1");
    }
  }
}

bool SimulatedSubject::feels_vibration(const Fingers& fingers, double rate_hz) {
  const auto function = functions_.find(fingers);
  if (function == functions_.end())
    throw UsageError("this simulated subject has no threshold with " + fingers.in_words());
  const FeltForces felt = press_plate(plate_, fingers, rate_hz);
  return uniform(random_) < function->second.vibrating(felt.renewed_hz);
}

}  // namespace kiroku::trainer
