#include "sim/haptics/simulated_hand.h"

#include <algorithm>
#include <utility>

#include "base/error.h"

namespace kiroku::sim {

SimulatedHand::SimulatedHand(std::vector<Path> paths, double period_s, const Impedance& impedance)
    : paths_(std::move(paths)), period_s_(period_s), impedance_(impedance) {
  const auto& [mass_kg, stiffness_n_m, damping_n_s_m] = impedance_;
  if (!(period_s > 0 && mass_kg > 0 && stiffness_n_m > 0 && damping_n_s_m > 0))
    throw UsageError("a simulated hand needs a period, a mass, a stiffness and a damping greater than zero");
  // Beyond this, the steps of its motion would grow without end.
  if (period_s * period_s * stiffness_n_m / mass_kg + period_s * damping_n_s_m / mass_kg > 1)
    throw UsageError("the period of a simulated hand is too long for its stiffness, damping and mass");
  for (const Path& path : paths_) poses_.push_back(path(0));
  velocities_m_s_.assign(paths_.size(), Vector3::Zero());
}

bool SimulatedHand::read(std::span<Pose> poses) {
  std::ranges::copy(poses_, poses.begin());
  return true;
}

void SimulatedHand::write(std::span<const Vector3> forces_n) {
  ++steps_;
  const double time_s = static_cast<double>(steps_) * period_s_;
  for (std::size_t tool = 0; tool < poses_.size(); ++tool) {
    const Pose wanted = paths_[tool](time_s);
    Vector3& velocity_m_s = velocities_m_s_[tool];
    const Vector3 force_n = forces_n[tool] +
                            impedance_.stiffness_n_m * (wanted.position_m - poses_[tool].position_m) -
                            impedance_.damping_n_s_m * velocity_m_s;
    // Velocity first, then position with the new one (semi-implicit Euler).
    velocity_m_s += period_s_ / impedance_.mass_kg * force_n;
    poses_[tool].position_m += period_s_ * velocity_m_s;
    poses_[tool].orientation = wanted.orientation;
  }
}

}  // namespace kiroku::sim
