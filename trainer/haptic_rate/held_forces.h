// Forces that are renewed at a rate of their own, lower than the force loop's, and held in between.
#pragma once

#include <vector>

#include "sim/haptics/force_loop.h"

namespace kiroku::trainer {

/// What a device plays when a simulation behind it is that slow: the stimulus of the haptic-rate experiment.
/// Belongs to the thread of the force loop.
class HeldForces : public sim::ForceSource {
 public:
  /// `source` must outlive it. kiroku::UsageError unless the rate is finite and greater than zero.
  HeldForces(sim::ForceSource& source, double rate_hz);
  /// Renews forces where 1 / rate has passed since they were due last; the source is told how long ago it was
  /// asked.
  void forces(std::span<const sim::Pose> poses, double period_s, std::span<sim::Vector3> forces_n) override;
  /// Renewed and held with the forces, so that a wrist that moves meanwhile feels no other torque.
  sim::WristForce wrist_force(const sim::Vector3& wrist_m) override;

 private:
  sim::ForceSource& source_;
  double interval_s_, since_due_s_, since_asked_s_ = 0;
  std::vector<sim::Vector3> held_n_;
  sim::WristForce held_wrist_;
  bool wrist_due_ = true;
};

}  // namespace kiroku::trainer
