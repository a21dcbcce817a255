#include "sim/cutting/shape_constraint.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include <Eigen/Geometry>

#include "sim/cutting/closest_point.h"

namespace kiroku::sim {
namespace {

double feature_cosine() { return std::cos(ShapeConstraint::kFeatureAngleDegrees * std::numbers::pi / 180); }

/// Faces between regions, seen from the lesser region.
std::vector<std::array<std::uint32_t, 3>> interfaces_of(const TetMesh& mesh, const Faces& faces) {
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (auto [one, other] : faces.between) {
    if (mesh.regions[one] == mesh.regions[other]) continue;
    if (mesh.regions[one] > mesh.regions[other]) std::swap(one, other);
    const Tetrahedron &corners = mesh.tetrahedra[one], &beyond = mesh.tetrahedra[other];
    for (std::size_t apex = 0; apex < 4; ++apex) {
      if (std::ranges::find(beyond, corners[apex]) != beyond.end()) continue;
      const auto& face = kFaceCorners[apex];
      triangles.push_back({corners[face[0]], corners[face[1]], corners[face[2]]});
    }
  }
  return triangles;
}

}  // namespace

ShapeConstraint::ShapeConstraint(const TetMesh& mesh, const Faces& faces)
    : nodes_(mesh.nodes),
      triangles_(interfaces_of(mesh, faces)),
      begin_(mesh.nodes.size() + 1),
      kind_(mesh.nodes.size(), NodeKind::kInner),
      line_(mesh.nodes.size()) {
  for (const Face& face : faces.surface) triangles_.push_back(face.nodes);
  for (const auto& corners : triangles_) {
    for (const std::uint32_t node : corners) {
      ++begin_[node + 1];
      kind_[node] = NodeKind::kFace;
    }
  }
  for (std::size_t node = 1; node < begin_.size(); ++node) begin_[node] += begin_[node - 1];
  around_.resize(begin_.back());
  std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
  for (std::uint32_t triangle = 0; triangle < triangles_.size(); ++triangle) {
    for (const std::uint32_t node : triangles_[triangle]) around_[next[node]++] = triangle;
  }

  struct Side {
    std::array<std::uint32_t, 2> nodes;
    std::uint32_t triangle;
  };
  std::vector<Side> sides;
  std::vector<Vector3> normals;
  sides.reserve(3 * triangles_.size());
  normals.reserve(triangles_.size());
  for (std::uint32_t triangle = 0; triangle < triangles_.size(); ++triangle) {
    const auto& [a, b, c] = triangles_[triangle];
    normals.push_back((nodes_[b] - nodes_[a]).cross(nodes_[c] - nodes_[a]).normalized());
    sides.push_back({{std::min(a, b), std::max(a, b)}, triangle});
    sides.push_back({{std::min(b, c), std::max(b, c)}, triangle});
    sides.push_back({{std::min(c, a), std::max(c, a)}, triangle});
  }
  std::ranges::sort(sides, [](const Side& one, const Side& other) {
    return std::tie(one.nodes, one.triangle) < std::tie(other.nodes, other.triangle);
  });
  std::vector<std::array<std::uint32_t, 2>> features;
  for (std::size_t one = 0, end = 0; one < sides.size(); one = end) {
    while (end < sides.size() && sides[end].nodes == sides[one].nodes) ++end;
    if (end - one != 2 ||
        normals[sides[one].triangle].dot(normals[sides[one + 1].triangle]) < feature_cosine())
      features.push_back(sides[one].nodes);
  }
  find_features(features);
}

void ShapeConstraint::find_features(const std::vector<std::array<std::uint32_t, 2>>& features) {
  std::vector<std::uint32_t> count(nodes_.size());
  for (const auto& edge : features) {
    for (std::size_t i = 0; i < 2; ++i) {
      const std::uint32_t node = edge[i];
      if (count[node] < 2) line_[node][count[node]] = edge[1 - i];
      ++count[node];
    }
  }
  for (std::size_t node = 0; node < nodes_.size(); ++node) {
    if (count[node] == 0) continue;
    kind_[node] = NodeKind::kCorner;
    if (count[node] != 2) continue;
    const Vector3 in = (nodes_[node] - nodes_[line_[node][0]]).normalized(),
                  out = (nodes_[line_[node][1]] - nodes_[node]).normalized();
    if (in.dot(out) > feature_cosine()) kind_[node] = NodeKind::kLine;
  }
}

Vector3 ShapeConstraint::nearest(std::uint32_t node, const Vector3& point) const {
  if (kind_[node] == NodeKind::kInner) return point;
  Vector3 best = nodes_[node];
  if (kind_[node] == NodeKind::kCorner) return best;
  double least = (best - point).squaredNorm();
  const auto consider = [&](const Vector3& candidate) {
    const double distance = (candidate - point).squaredNorm();
    if (distance >= least) return;
    least = distance;
    best = candidate;
  };
  if (kind_[node] == NodeKind::kLine) {
    for (const std::uint32_t end : line_[node])
      consider(closest_on_segment(point, nodes_[node], nodes_[end]));
    return best;
  }
  for (std::size_t i = begin_[node]; i < begin_[node + 1]; ++i) {
    const auto& [a, b, c] = triangles_[around_[i]];
    consider(closest_on_triangle(point, {nodes_[a], nodes_[b], nodes_[c]}));
  }
  return best;
}

}  // namespace kiroku::sim
