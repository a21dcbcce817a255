#include "sim/respiration/lung_surface.h"

#include <algorithm>

#include <Eigen/Geometry>

namespace kiroku::sim {
namespace {

/// Twice the area, along the outward normal.
Vector3 face_vector(const std::array<std::uint32_t, 3>& face, const LungSurface& surface,
                    const std::vector<Vector3>& positions_m) {
  const Vector3& a = positions_m[surface.nodes[face[0]]];
  return (positions_m[surface.nodes[face[1]]] - a).cross(positions_m[surface.nodes[face[2]]] - a);
}

}  // namespace

std::vector<Vector3> normals_at(const LungSurface& surface, const std::vector<Vector3>& positions_m) {
  std::vector<Vector3> sums(surface.nodes.size(), Vector3::Zero()), largest = sums;
  for (const auto& face : surface.faces) {
    const Vector3 normal = face_vector(face, surface, positions_m);
    for (const std::uint32_t row : face) {
      sums[row] += normal;
      if (normal.squaredNorm() > largest[row].squaredNorm()) largest[row] = normal;
    }
  }
  constexpr double kCancelled = 1e-9;
  for (std::size_t row = 0; row < sums.size(); ++row) {
    if (sums[row].norm() <= kCancelled * largest[row].norm()) sums[row] = largest[row];
    sums[row].normalize();
  }
  return sums;
}

LungSurface surface_of(const TetMesh& mesh) {
  LungSurface surface;
  const std::vector<Face> faces = faces_of(mesh).surface;
  surface.row_of.assign(mesh.nodes.size(), -1);
  for (const Face& face : faces) {
    for (const std::uint32_t node : face.nodes) surface.row_of[node] = 0;
  }
  for (std::uint32_t node = 0; node < mesh.nodes.size(); ++node) {
    if (surface.row_of[node] < 0) continue;
    surface.row_of[node] = static_cast<std::int64_t>(surface.nodes.size());
    surface.nodes.push_back(node);
  }
  surface.areas_m2.resize(surface.nodes.size());
  surface.neighbours.resize(surface.nodes.size());
  for (const Face& face : faces) {
    std::array<std::uint32_t, 3> rows{};
    for (std::size_t i = 0; i < 3; ++i) rows[i] = static_cast<std::uint32_t>(surface.row_of[face.nodes[i]]);
    surface.faces.push_back(rows);
    const double third_m2 = face_vector(rows, surface, mesh.nodes).norm() / 6;
    for (std::size_t i = 0; i < 3; ++i) {
      surface.areas_m2[rows[i]] += third_m2;
      surface.neighbours[rows[i]].push_back(rows[(i + 1) % 3]);
      surface.neighbours[rows[i]].push_back(rows[(i + 2) % 3]);
    }
  }
  for (auto& beside : surface.neighbours) {
    std::ranges::sort(beside);
    beside.erase(std::unique(beside.begin(), beside.end()), beside.end());
  }
  surface.normals = normals_at(surface, mesh.nodes);
  return surface;
}

}  // namespace kiroku::sim
