#include "sim/meshing/mesh_quality.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>

namespace kiroku::sim {
namespace {

/// Of the sphere through the four nodes, from the products of opposite edges (Crelle): 6 R V is the area
/// of a triangle with those products as sides.
double radius_edge_ratio(const TetMesh& mesh, std::size_t tetrahedron) {
  const Tetrahedron& corner = mesh.tetrahedra[tetrahedron];
  const auto length = [&](std::size_t a, std::size_t b) {
    return (mesh.nodes[corner[a]] - mesh.nodes[corner[b]]).norm();
  };
  const std::array<double, 6> edges{length(0, 1), length(0, 2), length(0, 3),
                                    length(2, 3), length(1, 3), length(1, 2)};
  const double a = edges[0] * edges[3], b = edges[1] * edges[4], c = edges[2] * edges[5];
  const double half = (a + b + c) / 2;
  const double area = std::sqrt(std::max(half * (half - a) * (half - b) * (half - c), 0.0));
  return area / (6 * signed_volume_m3(mesh, tetrahedron)) / *std::ranges::min_element(edges);
}

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

}  // namespace

std::array<double, 6> dihedral_angles_rad(const TetMesh& mesh, std::size_t tetrahedron) {
  // Each edge, and the two corners beside it.
  constexpr std::array<std::array<std::size_t, 4>, 6> kEdges{
      {{0, 1, 2, 3}, {0, 2, 1, 3}, {0, 3, 1, 2}, {1, 2, 0, 3}, {1, 3, 0, 2}, {2, 3, 0, 1}}};
  const Tetrahedron& corner = mesh.tetrahedra[tetrahedron];
  std::array<double, 6> angles{};
  for (std::size_t edge = 0; edge < kEdges.size(); ++edge) {
    const Vector3& from = mesh.nodes[corner[kEdges[edge][0]]];
    const Vector3 along = mesh.nodes[corner[kEdges[edge][1]]] - from;
    const Vector3 one = along.cross(mesh.nodes[corner[kEdges[edge][2]]] - from);
    const Vector3 other = along.cross(mesh.nodes[corner[kEdges[edge][3]]] - from);
    angles[edge] = std::atan2(one.cross(other).norm(), one.dot(other));
  }
  return angles;
}

MeshQuality measure_quality(const TetMesh& mesh) {
  MeshQuality quality;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  quality.least_dihedral_deg = quality.least_volume_m3 = kInfinity;
  std::vector<double> least_angles, ratios;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    std::array<double, 6> angles = dihedral_angles_rad(mesh, t);
    for (double& angle : angles) angle *= 180 / std::numbers::pi;
    const auto [least, greatest] = std::ranges::minmax(angles);
    least_angles.push_back(least);
    quality.least_dihedral_deg = std::min(quality.least_dihedral_deg, least);
    quality.greatest_dihedral_deg = std::max(quality.greatest_dihedral_deg, greatest);
    if (least < 8) ++quality.below_8_deg;
    if (least < 12) ++quality.below_12_deg;
    ratios.push_back(radius_edge_ratio(mesh, t));
    quality.greatest_radius_edge = std::max(quality.greatest_radius_edge, ratios.back());
    const double volume_m3 = signed_volume_m3(mesh, t);
    quality.least_volume_m3 = std::min(quality.least_volume_m3, volume_m3);
    quality.greatest_volume_m3 = std::max(quality.greatest_volume_m3, volume_m3);
    quality.volume_m3 += volume_m3;
    RegionMeasures& region = quality.regions[mesh.regions[t]];
    ++region.tetrahedra;
    region.volume_m3 += volume_m3;
  }
  quality.median_least_dihedral_deg = median(least_angles);
  quality.median_radius_edge = median(ratios);
  return quality;
}

}  // namespace kiroku::sim
