#include "sim/render/vertex_rotations.h"

#include <algorithm>

#include <Eigen/LU>

#include "sim/fem/corotational_element.h"
#include "sim/mesh/node_graph.h"

namespace kiroku::sim {
namespace {

/// The rotation of F's polar decomposition. Newton's iteration X <- (X + X^-T) / 2 (Higham, 1986) doubles its
/// digits each time where F is far from singular; else singular values.
Eigen::Matrix3d rotation_of(const Eigen::Matrix3d& deformation) {
  constexpr double kFarFromSingular = 0.05;
  // Of the squared change: the error after it is about half of the change's square, less than a float's step.
  constexpr double kConverged = 1e-8;
  const double size = deformation.norm();
  if (deformation.determinant() > kFarFromSingular * size * size * size / 27) {
    constexpr int kMost = 12;
    Eigen::Matrix3d at = deformation;
    for (int i = 0; i < kMost; ++i) {
      const Eigen::Matrix3d next = (at + at.inverse().transpose()) / 2;
      const double change = (next - at).squaredNorm();
      at = next;
      if (change < kConverged) return at;
    }
  }
  return principal_stretches(deformation).rotation();
}

}  // namespace

VertexRotations::VertexRotations(const TetMesh& rest)
    : rest_m_(rest.nodes),
      begin_(rest.nodes.size() + 1),
      inverse_(rest.nodes.size(), Eigen::Matrix3d::Zero()) {
  const NodeGraph graph = node_graph_of(rest);
  const auto each_edge = [&](const auto& visit) {
    for (std::uint32_t node = 0; node < rest.nodes.size(); ++node) {
      for (std::size_t at = graph.begin[node]; at < graph.begin[node + 1]; ++at) {
        if (graph.rows[at] != node) visit(node, graph.rows[at]);
      }
    }
  };
  each_edge([&](std::uint32_t a, std::uint32_t b) { ++begin_[a + 1], ++begin_[b + 1]; });
  for (std::size_t node = 0; node < rest.nodes.size(); ++node) begin_[node + 1] += begin_[node];
  neighbours_.resize(begin_.back());
  std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
  each_edge([&](std::uint32_t a, std::uint32_t b) {
    neighbours_[next[a]++] = b;
    neighbours_[next[b]++] = a;
  });
  for (std::size_t node = 0; node < rest.nodes.size(); ++node) {
    const auto first = neighbours_.begin() + static_cast<std::ptrdiff_t>(begin_[node]);
    std::sort(first, neighbours_.begin() + static_cast<std::ptrdiff_t>(begin_[node + 1]));
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (std::size_t at = begin_[node]; at < begin_[node + 1]; ++at) {
      const Vector3 edge = rest_m_[neighbours_[at]] - rest_m_[node];
      sum += edge * edge.transpose();
    }
    // Relative to a neighbourhood that is as wide in all directions.
    const double size = sum.trace() / 3;
    constexpr double kFlat = 1e-6;
    if (sum.determinant() > kFlat * size * size * size) inverse_[node] = sum.inverse();
  }
}

void VertexRotations::compute(std::span<const Vector3> positions_m,
                              std::vector<Eigen::Quaterniond>& rotations) const {
  rotations.resize(rest_m_.size());
  for (std::size_t node = 0; node < rest_m_.size(); ++node) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (std::size_t at = begin_[node]; at < begin_[node + 1]; ++at) {
      const std::uint32_t other = neighbours_[at];
      sum += (positions_m[other] - positions_m[node]) * (rest_m_[other] - rest_m_[node]).transpose();
    }
    if (begin_[node] == begin_[node + 1]) {
      rotations[node] = Eigen::Quaterniond::Identity();
      continue;
    }
    const bool flat = inverse_[node].isZero();
    rotations[node] = Eigen::Quaterniond(rotation_of(flat ? sum : sum * inverse_[node])).normalized();
  }
}

}  // namespace kiroku::sim
