#include "sim/respiration/breathing.h"

#include <utility>

#include <Eigen/Geometry>

#include "sim/mesh/degrees_of_freedom.h"

namespace kiroku::sim {
namespace {

/// Its third column is the direction.
Eigen::Matrix3d axes_along(const Vector3& direction) {
  Eigen::Matrix3d axes;
  axes.col(0) = direction.unitOrthogonal();
  axes.col(1) = direction.cross(axes.col(0));
  axes.col(2) = direction;
  return axes;
}

}  // namespace

BreathingBody::BreathingBody(TetMesh mesh, const Materials& materials, const BoundaryGroups& groups,
                             const Vector3& slide)
    : surface_(surface_of(mesh)), groups_(groups) {
  Constraints constraints(mesh.nodes.size());
  const Eigen::Matrix3d axes = axes_along(slide);
  for (std::size_t node = 0; node < groups_.size(); ++node) {
    switch (groups_[node]) {
      case BoundaryGroup::kInside:
      case BoundaryGroup::kFree:
        break;
      case BoundaryGroup::kRibCage:
      case BoundaryGroup::kDiaphragm:
      case BoundaryGroup::kTrachea:
        constraints.prescribe(node, Vector3::Zero(), name_of(groups_[node]));
        break;
      case BoundaryGroup::kBack:
        constraints.turn(node, axes);
        constraints.prescribe(node, 0, 0, name_of(groups_[node]));
        constraints.prescribe(node, 1, 0, name_of(groups_[node]));
        break;
    }
  }
  body_ = std::make_unique<ElasticBody>(std::move(mesh), materials, std::move(constraints));
}

Eigen::VectorXd BreathingBody::response(BoundaryGroup group, const std::optional<Vector3>& direction) const {
  // Nodes of the moved groups have the mesh's axes.
  Eigen::VectorXd moved = Eigen::VectorXd::Zero(first_row(groups_.size()));
  for (std::size_t node = 0; node < groups_.size(); ++node) {
    if (groups_[node] != group) continue;
    moved.segment<3>(first_row(node)) =
        direction ? *direction : surface_.normals[static_cast<std::size_t>(surface_.row_of[node])];
  }
  return body_->solve(Eigen::VectorXd::Zero(moved.size()), moved).displacement_m;
}

BreathingCycle::BreathingCycle(const BreathingBody& body, const BreathingMotion& motion, Waveform waveform)
    : motion_(motion),
      waveform_(std::move(waveform)),
      rib_cage_(body.response(BoundaryGroup::kRibCage, motion.rib_cage.direction)),
      diaphragm_(body.response(BoundaryGroup::kDiaphragm, motion.diaphragm.direction)) {}

Eigen::VectorXd BreathingCycle::displacement_m(double time_s) const {
  return rib_cage_m(time_s) * rib_cage_ + diaphragm_m(time_s) * diaphragm_;
}

}  // namespace kiroku::sim
