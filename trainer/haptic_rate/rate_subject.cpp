#include "trainer/haptic_rate/rate_subject.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "base/error.h"
#include "trainer/haptic_rate/held_forces.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

constexpr double kPeriodSeconds = 5e-4, kPressSeconds = 1.7;
constexpr double kLeastSeconds = 2, kLeastRenewals = 4;
/// A stiff hand, so that it goes where the press is wanted and gives way by a tenth of a millimetre or two.
constexpr sim::SimulatedHand::Impedance kHand{0.05, 5000, 30};

}  // namespace

double uniform(std::mt19937& random) { return static_cast<double>(random()) / 4294967296.0; }

FeltForces press_plate(const Plate& plate, std::size_t fingers, double rate_hz) {
  const std::vector<sim::Pose> lightly = plate.pressing(fingers, kLeastPressN),
                               firmly = plate.pressing(fingers, kMostPressN);
  std::vector<sim::SimulatedHand::Path> paths;
  for (std::size_t i = 0; i < fingers; ++i) {
    paths.emplace_back([&, i](double time_s) {
      const double share = (1 - std::cos(2 * std::numbers::pi * time_s / kPressSeconds)) / 2;
      sim::Pose pose = lightly[i];
      pose.position_m += share * (firmly[i].position_m - lightly[i].position_m);
      // What the hand's spring gives way by under the force that is wanted.
      pose.position_m.z() -= (kLeastPressN + share * (kMostPressN - kLeastPressN)) / kHand.stiffness_n_m;
      return pose;
    });
  }
  sim::SimulatedHand hand(paths, kPeriodSeconds, kHand);
  PlateForces contact(plate, lightly);
  HeldForces held(contact, rate_hz);
  std::vector<sim::Pose> poses(fingers);
  std::vector<Vector3> forces_n(fingers), before_n(fingers);
  const auto steps =
      static_cast<std::int64_t>(std::max(kLeastSeconds, kLeastRenewals / rate_hz) / kPeriodSeconds);
  FeltForces felt{0, std::numeric_limits<double>::infinity(), 0};
  std::int64_t first = -1, last = -1, changes = 0;
  for (std::int64_t step = 0; step <= steps; ++step) {
    hand.read(poses);
    held.forces(poses, kPeriodSeconds, forces_n);
    hand.write(forces_n);
    if (step > 0 && forces_n != before_n) {
      if (first < 0) first = step;
      last = step;
      ++changes;
    }
    before_n = forces_n;
    double mean_n = 0;
    for (const Vector3& force_n : forces_n) mean_n += force_n.norm() / static_cast<double>(fingers);
    felt.least_n = std::min(felt.least_n, mean_n);
    felt.greatest_n = std::max(felt.greatest_n, mean_n);
  }
  if (changes > 1)
    felt.renewed_hz = static_cast<double>(changes - 1) / (static_cast<double>(last - first) * kPeriodSeconds);
  return felt;
}

SimulatedSubject::SimulatedSubject(const Plate& plate, std::vector<PsychometricFunction> functions,
                                   std::uint32_t seed)
    : plate_(plate), functions_(std::move(functions)), random_(seed) {
  for (const PsychometricFunction& function : functions_) {
    if (!(function.threshold_hz > 0) || !(function.spread > 0) || !std::isfinite(function.threshold_hz) ||
        !std::isfinite(function.spread) || !(function.lapse_rate >= 0 && function.lapse_rate < 1)) {
      throw UsageError(
          "a simulated subject needs a threshold and a spread greater than zero, and a lapse rate below 1");
    }
  }
}

bool SimulatedSubject::feels_vibration(std::size_t fingers, double rate_hz) {
  if (fingers < 1 || fingers > functions_.size()) {
    throw UsageError("this simulated subject knows presses with 1 to " + std::to_string(functions_.size()) +
                     " fingers, not with " + std::to_string(fingers));
  }
  const FeltForces felt = press_plate(plate_, fingers, rate_hz);
  return uniform(random_) < functions_[fingers - 1].vibrating(felt.renewed_hz);
}

}  // namespace kiroku::trainer
