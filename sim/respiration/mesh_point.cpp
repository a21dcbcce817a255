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

MeshLocator::MeshLocator(const TetMesh& mesh) : mesh_(mesh) {
  double sides_m = 0;
  for (const Tetrahedron& corners : mesh.tetrahedra) {
    const Vector3& origin = mesh.nodes[corners[0]];
    Eigen::Matrix3d edges;
    for (std::size_t i = 0; i < 3; ++i)
      edges.col(static_cast<Eigen::Index>(i)) = mesh.nodes[corners[i + 1]] - origin;
    to_weights_.emplace_back(edges.inverse());
    sides_m += edges.col(0).norm();
  }
  if (!mesh.tetrahedra.empty()) cell_m_ = sides_m / static_cast<double>(mesh.tetrahedra.size());
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    Vector3 least = mesh.nodes[mesh.tetrahedra[t][0]], greatest = least;
    for (const std::uint32_t node : mesh.tetrahedra[t]) {
      least = least.cwiseMin(mesh.nodes[node]);
      greatest = greatest.cwiseMax(mesh.nodes[node]);
    }
    const Cell from = cell_of(least), to = cell_of(greatest);
    for (long k = from[2]; k <= to[2]; ++k) {
      for (long j = from[1]; j <= to[1]; ++j) {
        for (long i = from[0]; i <= to[0]; ++i) elements_in_[{i, j, k}].push_back(t);
      }
    }
  }
}

MeshLocator::Cell MeshLocator::cell_of(const Vector3& place_m) const {
  const Vector3 cell = (place_m / cell_m_).array().floor();
  return {std::lround(cell.x()), std::lround(cell.y()), std::lround(cell.z())};
}

Eigen::Vector4d MeshLocator::weights_at(std::uint32_t tetrahedron, const Vector3& place_m) const {
  const Vector3 part = to_weights_[tetrahedron] * (place_m - mesh_.nodes[mesh_.tetrahedra[tetrahedron][0]]);
  return {1 - part.sum(), part.x(), part.y(), part.z()};
}

LocatedPoint MeshLocator::located(std::uint32_t tetrahedron, const Eigen::Vector4d& weights,
                                  double outside_m) const {
  const Tetrahedron& corners = mesh_.tetrahedra[tetrahedron];
  return {{{corners.begin(), corners.end()}, {weights.begin(), weights.end()}}, tetrahedron, outside_m};
}

LocatedPoint MeshLocator::locate(const Vector3& place_m) const {
  if (const auto cell = elements_in_.find(cell_of(place_m)); cell != elements_in_.end()) {
    for (const std::uint32_t t : cell->second) {
      if (const Eigen::Vector4d weights = weights_at(t, place_m); weights.minCoeff() >= 0)
        return located(t, weights, 0);
    }
  }
  double least_m = std::numeric_limits<double>::infinity();
  std::uint32_t nearest = 0;
  for (std::uint32_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
    const Eigen::Vector4d weights = weights_at(t, place_m);
    // The nearest place of the element, but for rounding its corners off.
    const Eigen::Vector4d clipped = weights.cwiseMax(0.0) / weights.cwiseMax(0.0).sum();
    Vector3 there_m = Vector3::Zero();
    for (std::size_t i = 0; i < 4; ++i)
      there_m += clipped[static_cast<Eigen::Index>(i)] * mesh_.nodes[mesh_.tetrahedra[t][i]];
    const double outside_m = weights.minCoeff() >= 0 ? 0 : (there_m - place_m).norm();
    if (!(outside_m < least_m)) continue;
    least_m = outside_m;
    nearest = t;
  }
  return located(nearest, weights_at(nearest, place_m), least_m);
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
