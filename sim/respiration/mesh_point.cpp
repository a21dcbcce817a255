#include "sim/respiration/mesh_point.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/LU>

namespace kiroku::sim {

Vector3 MeshPoint::mean(const std::vector<Vector3>& of_nodes) const {
  Vector3 sum = Vector3::Zero();
  for (std::size_t i = 0; i < nodes.size(); ++i) sum += weights[i] * of_nodes[nodes[i]];
  return sum;
}

Vector3 MeshPoint::mean(const Eigen::VectorXd& of_nodes) const {
  Vector3 sum = Vector3::Zero();
  for (std::size_t i = 0; i < nodes.size(); ++i)
    sum += weights[i] * of_nodes.segment<3>(static_cast<Eigen::Index>(3 * std::size_t{nodes[i]}));
  return sum;
}

LocatedPoint locate(const TetMesh& mesh, const Vector3& place_m) {
  LocatedPoint best{{}, std::numeric_limits<double>::infinity()};
  for (const Tetrahedron& corners : mesh.tetrahedra) {
    const Vector3& origin = mesh.nodes[corners[0]];
    Eigen::Matrix3d edges;
    for (std::size_t i = 0; i < 3; ++i)
      edges.col(static_cast<Eigen::Index>(i)) = mesh.nodes[corners[i + 1]] - origin;
    const Vector3 part = edges.inverse() * (place_m - origin);
    const Eigen::Vector4d weights(1 - part.sum(), part.x(), part.y(), part.z());
    // The nearest place of the element, but for rounding its corners off.
    const Eigen::Vector4d clipped = weights.cwiseMax(0.0) / weights.cwiseMax(0.0).sum();
    const double outside_m =
        weights.minCoeff() >= 0 ? 0 : (origin + edges * clipped.tail<3>() - place_m).norm();
    if (!(outside_m < best.outside_m)) continue;
    best.outside_m = outside_m;
    best.point.nodes.assign(corners.begin(), corners.end());
    best.point.weights.assign(weights.begin(), weights.end());
    if (outside_m == 0) break;
  }
  return best;
}

void mark_voxels(const std::vector<Vector3>& positions_m, const std::vector<Tetrahedron>& tetrahedra,
                 const Grid& grid, std::vector<std::uint8_t>& marked) {
  constexpr double kOnFace = 1e-9;
  for (const Tetrahedron& corners : tetrahedra) {
    std::array<Vector3, 4> at;
    for (std::size_t i = 0; i < 4; ++i) at[i] = grid.index(positions_m[corners[i]]);
    Eigen::Matrix3d edges;
    for (std::size_t i = 0; i < 3; ++i) edges.col(static_cast<Eigen::Index>(i)) = at[i + 1] - at[0];
    if (edges.determinant() == 0) continue;
    const Eigen::Matrix3d inverse = edges.inverse();
    const Vector3 least = at[0].cwiseMin(at[1]).cwiseMin(at[2]).cwiseMin(at[3]),
                  greatest = at[0].cwiseMax(at[1]).cwiseMax(at[2]).cwiseMax(at[3]);
    std::array<std::size_t, 3> from{}, to{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<Eigen::Index>(axis);
      const auto size = static_cast<double>(grid.size[axis]);
      from[axis] = static_cast<std::size_t>(std::clamp(std::ceil(least[a]), 0.0, size));
      to[axis] = static_cast<std::size_t>(std::clamp(std::floor(greatest[a]) + 1, 0.0, size));
    }
    for (std::size_t k = from[2]; k < to[2]; ++k) {
      for (std::size_t j = from[1]; j < to[1]; ++j) {
        for (std::size_t i = from[0]; i < to[0]; ++i) {
          const Vector3 index(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k));
          const Vector3 part = inverse * (index - at[0]);
          if (part.minCoeff() >= -kOnFace && part.sum() <= 1 + kOnFace) marked[grid.offset(i, j, k)] = 1;
        }
      }
    }
  }
}

}  // namespace kiroku::sim
