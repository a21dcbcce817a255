// A hand around its fingertips: phalanges and palm as capsules, so that a power grasp touches, too.
//
// Frames: of a fingertip and of the wrist alike, y goes from the wrist towards the fingertips, z the way the
// fingers bend (out of the palm, out of a finger's pad), x across. A finger has three capsules behind its
// fingertip. The distal one lies along the fingertip's y axis. The other two go from there to the knuckle,
// bent away from the way the finger bends; where a knuckle is too far off, they lie on the straight line.
// Sizes are those of an adult's hand, ours.
#pragma once

#include <span>
#include <vector>

#include "sim/contact/contact_solver.h"

namespace kiroku::trainer {

/// Of one number of fingers. Immutable; thread-safe.
class HandShape {
 public:
  static constexpr std::size_t kPhalanges = 3, kPalmCapsules = 3;
  static constexpr double kKnuckleMetres = 0.09, kPalmMiddleMetres = 0.05;  // from the wrist
  static constexpr double kKnucklesApartMetres = 0.022;
  static constexpr double kProximalMetres = 0.042, kMiddleMetres = 0.025, kDistalMetres = 0.018;
  static constexpr double kPhalanxRadiusMetres = 0.007, kPalmRadiusMetres = 0.012;

  explicit HandShape(std::size_t fingers) : fingers_(fingers) {}

  /// Behind the fingertips: phalanges finger by finger, from the fingertip on, then the palm.
  [[nodiscard]] std::size_t parts() const { return fingers_ * kPhalanges + kPalmCapsules; }
  /// As many tools as parts(), named for errors; `friction` as of fingertips().
  [[nodiscard]] std::vector<sim::ContactTool> tools(double friction) const;
  /// Where they are; parts() poses into `parts`. Allocates nothing.
  void place(const sim::Pose& wrist, std::span<const sim::Pose> fingertips, std::span<sim::Pose> parts) const;

  /// Where the wrist of a hand is that says nothing of it: behind the middle of its fingertips, which are
  /// taken to be nearly straight. At least one fingertip.
  [[nodiscard]] static sim::Pose wrist_behind(std::span<const sim::Pose> fingertips);

 private:
  std::size_t fingers_;
};

}  // namespace kiroku::trainer
