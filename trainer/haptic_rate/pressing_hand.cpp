#include "trainer/haptic_rate/pressing_hand.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace kiroku::trainer {
namespace {

constexpr double kLeastSeconds = 2, kLeastRenewals = 4;
/// A stiff hand, so that it goes where the press is wanted and gives way by a tenth of a millimetre or two.
constexpr sim::SimulatedHand::Impedance kHand{0.05, 5000, 30};

std::vector<sim::SimulatedHand::Path> paths_of(const Plate& plate, const Fingers& fingers) {
  const std::vector<sim::Pose> lightly = plate.pressing(fingers, kLeastPressN),
                               firmly = plate.pressing(fingers, kMostPressN);
  std::vector<sim::SimulatedHand::Path> paths;
  for (std::size_t i = 0; i < lightly.size(); ++i) {
    paths.emplace_back([from = lightly[i], to = firmly[i]](double time_s) {
      const double share = (1 - std::cos(2 * std::numbers::pi * time_s / kPressSeconds)) / 2;
      sim::Pose pose = from;
      pose.position_m += share * (to.position_m - from.position_m);
      // What the hand's spring gives way by under the force that is wanted.
      pose.position_m.z() -= (kLeastPressN + share * (kMostPressN - kLeastPressN)) / kHand.stiffness_n_m;
      return pose;
    });
  }
  return paths;
}

}  // namespace

std::int64_t press_steps(double rate_hz) {
  return static_cast<std::int64_t>(std::max(kLeastSeconds, kLeastRenewals / rate_hz) / kForcePeriodSeconds);
}

PressingHand::PressingHand(const Plate& plate, const Fingers& fingers)
    : hand(paths_of(plate, fingers), kForcePeriodSeconds, kHand),
      contact(plate, plate.pressing(fingers, kLeastPressN)) {}

}  // namespace kiroku::trainer
