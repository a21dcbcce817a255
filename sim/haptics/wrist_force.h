// What a hand's wrist bears of the tools that the hand holds.
#pragma once

#include <span>

#include "sim/contact/pose.h"

namespace kiroku::sim {

/// In the mesh's frame.
struct WristForce {
  Vector3 force_n = Vector3::Zero();
  Vector3 torque_nm = Vector3::Zero();  // about the wrist
};

/// The sum of the forces on all tools (Eq. 6 of "Construction of Training Environment for Surgical Exclusion
/// with a Basic Study of Multi-finger Haptic Interaction"), and their torque about a wrist at `wrist_m`: that
/// of each force at its tool's origin, and each tool's own about its origin. As many forces and torques as
/// poses. The hand's inertia is left out, as in the paper. Pure; thread-safe.
inline WristForce wrist_force_of(const Vector3& wrist_m, std::span<const Pose> poses,
                                 std::span<const Vector3> forces_n, std::span<const Vector3> torques_nm) {
  WristForce wrist;
  for (std::size_t tool = 0; tool < poses.size(); ++tool) {
    wrist.force_n += forces_n[tool];
    wrist.torque_nm += (poses[tool].position_m - wrist_m).cross(forces_n[tool]) + torques_nm[tool];
  }
  return wrist;
}

}  // namespace kiroku::sim
