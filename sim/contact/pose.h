// Where a rigid tool is. Pure, thread-safe.
#pragma once

#include <Eigen/Geometry>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// x in the mesh's frame = orientation * (x in the tool's frame) + position_m. The quaternion has length 1.
struct Pose {
  Vector3 position_m = Vector3::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();

  [[nodiscard]] Vector3 to_tool(const Vector3& point_m) const {
    return orientation.conjugate() * (point_m - position_m);
  }
  [[nodiscard]] Vector3 from_tool(const Vector3& point_m) const { return orientation * point_m + position_m; }
  /// Numbers that are no pose would leave as forces: false for what is not finite or not of length 1.
  [[nodiscard]] bool sound() const {
    return position_m.allFinite() && std::abs(orientation.norm() - 1) <= 1e-6;
  }
};

}  // namespace kiroku::sim
