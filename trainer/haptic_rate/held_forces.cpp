#include "trainer/haptic_rate/held_forces.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace kiroku::trainer {

HeldForces::HeldForces(sim::ForceSource& source, double rate_hz)
    : source_(source), interval_s_(1 / rate_hz), since_due_s_(interval_s_) {
  if (!(rate_hz > 0) || !std::isfinite(rate_hz))
    throw UsageError("forces need a rate greater than zero to be renewed at");
}

void HeldForces::forces(std::span<const sim::Pose> poses, double period_s, std::span<sim::Vector3> forces_n) {
  since_asked_s_ += period_s;
  // Half a period of the loop: the step nearest to when they are due.
  if (held_n_.size() != forces_n.size() || since_due_s_ > interval_s_ - period_s / 2) {
    held_n_.resize(forces_n.size());
    source_.forces(poses, since_asked_s_, held_n_);
    wrist_due_ = true;
    since_asked_s_ = 0;
    since_due_s_ = std::fmod(since_due_s_ + period_s / 2, interval_s_) - period_s / 2;
  }
  since_due_s_ += period_s;
  std::ranges::copy(held_n_, forces_n.begin());
}

sim::WristForce HeldForces::wrist_force(const sim::Vector3& wrist_m) {
  if (wrist_due_) held_wrist_ = source_.wrist_force(wrist_m);
  wrist_due_ = false;
  return held_wrist_;
}

}  // namespace kiroku::trainer
