#include "sim/mesh/tet_mesh.h"

#include <algorithm>

#include <Eigen/Geometry>

namespace kiroku::sim {

double signed_volume_m3(const TetMesh& mesh, std::size_t tetrahedron) {
  const Tetrahedron& corner = mesh.tetrahedra[tetrahedron];
  const Vector3& a = mesh.nodes[corner[0]];
  const Vector3 ab = mesh.nodes[corner[1]] - a;
  const Vector3 ac = mesh.nodes[corner[2]] - a;
  const Vector3 ad = mesh.nodes[corner[3]] - a;
  return ab.cross(ac).dot(ad) / 6;
}

Extent extent_of(const TetMesh& mesh) {
  if (mesh.nodes.empty()) return {};
  Extent extent{mesh.nodes.front(), mesh.nodes.front()};
  for (const Vector3& node : mesh.nodes) {
    extent.least = extent.least.cwiseMin(node);
    extent.greatest = extent.greatest.cwiseMax(node);
  }
  return extent;
}

std::vector<bool> nodes_in_use(const TetMesh& mesh) {
  std::vector<bool> used(mesh.nodes.size());
  for (const Tetrahedron& corners : mesh.tetrahedra) {
    for (const std::uint32_t node : corners) used[node] = true;
  }
  return used;
}

std::vector<std::int32_t> regions_of(const TetMesh& mesh) {
  std::vector<std::int32_t> regions;
  for (const std::int32_t region : mesh.regions) {
    // Elements of one region mostly stand together.
    if (regions.empty() || regions.back() != region) regions.push_back(region);
  }
  std::ranges::sort(regions);
  regions.erase(std::unique(regions.begin(), regions.end()), regions.end());
  return regions;
}

}  // namespace kiroku::sim
