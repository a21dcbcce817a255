#include "sim/cutting/rest_mapping.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "base/error.h"
#include "sim/cutting/closest_point.h"

namespace kiroku::sim {

RestMapping::RestMapping(const VertexPreservingCut& shape, const Eigen::VectorXd& displacement_m)
    : shape_(shape), deformed_m_(shape.mesh().nodes), surface_(shape.surface()) {
  if (displacement_m.size() != static_cast<Eigen::Index>(3 * deformed_m_.size()))
    throw Error("the displacement has " + std::to_string(displacement_m.size()) + " components, the body " +
                std::to_string(3 * deformed_m_.size()));
  if (!displacement_m.allFinite()) throw Error("the displacement is not finite");
  for (std::size_t node = 0; node < deformed_m_.size(); ++node)
    deformed_m_[node] += displacement_m.segment<3>(static_cast<Eigen::Index>(3 * node));
}

Vector3 RestMapping::to_rest(const Vector3& deformed_m) const {
  return mapped(deformed_m, deformed_m_, shape_.mesh().nodes);
}

Vector3 RestMapping::to_deformed(const Vector3& rest_m) const {
  return mapped(rest_m, shape_.mesh().nodes, deformed_m_);
}

/// As the body's nodes go from one set of places to the other.
Vector3 RestMapping::mapped(const Vector3& point_m, const std::vector<Vector3>& from_m,
                            const std::vector<Vector3>& to_m) const {
  constexpr double kOnBorder = 1e-12;  // weights may miss a face by rounding
  const TetMesh& mesh = shape_.mesh();
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    if (!shape_.present(t)) continue;
    const Tetrahedron& corners = mesh.tetrahedra[t];
    const Vector3& origin = from_m[corners[0]];
    Eigen::Matrix3d sides, sides_there;
    for (Eigen::Index i = 0; i < 3; ++i) {
      const std::uint32_t node = corners[static_cast<std::size_t>(i) + 1];
      sides.col(i) = from_m[node] - origin;
      sides_there.col(i) = to_m[node] - to_m[corners[0]];
    }
    const Vector3 arm = point_m - origin;
    if (arm.squaredNorm() > sides.colwise().squaredNorm().maxCoeff()) continue;  // farther than any corner
    const double six_volumes = sides.determinant();
    if (!(std::abs(six_volumes) > 0)) continue;
    const Vector3 weights(arm.dot(sides.col(1).cross(sides.col(2))) / six_volumes,
                          arm.dot(sides.col(2).cross(sides.col(0))) / six_volumes,
                          arm.dot(sides.col(0).cross(sides.col(1))) / six_volumes);
    if (weights.minCoeff() >= -kOnBorder && weights.sum() <= 1 + kOnBorder)
      return to_m[corners[0]] + sides_there * weights;
  }
  Vector3 mapped_m = point_m;
  double least = -1;
  for (const Face& face : surface_) {
    const std::array<Vector3, 3> triangle{from_m[face.nodes[0]], from_m[face.nodes[1]],
                                          from_m[face.nodes[2]]};
    const Vector3 weights = closest_weights(point_m, triangle);
    Vector3 here_m = Vector3::Zero(), there_m = Vector3::Zero();
    for (std::size_t i = 0; i < 3; ++i) {
      here_m += weights[static_cast<Eigen::Index>(i)] * triangle[i];
      there_m += weights[static_cast<Eigen::Index>(i)] * to_m[face.nodes[i]];
    }
    const double distance = (here_m - point_m).squaredNorm();
    if (least >= 0 && distance >= least) continue;
    least = distance;
    mapped_m = point_m + there_m - here_m;
  }
  return mapped_m;
}

}  // namespace kiroku::sim
