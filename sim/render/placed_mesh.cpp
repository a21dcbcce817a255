#include "sim/render/placed_mesh.h"

#include <algorithm>
#include <limits>

#include "sim/mesh/length_unit.h"

namespace kiroku::sim {

PlacedMesh::PlacedMesh(const TetMesh& rest_mesh)
    : rest(rest_mesh), topology(proxy_topology(rest)), rotations(rest) {}

void PlacedMesh::place_nodes(std::span<const double> displacement_m, const Camera& camera) {
  const std::size_t nodes = rest.nodes.size();
  positions_m = rest.nodes;
  if (!displacement_m.empty()) {
    for (std::size_t node = 0; node < nodes; ++node)
      positions_m[node] += Eigen::Map<const Vector3>(displacement_m.data() + 3 * node);
  }
  view_mm.resize(nodes);
  positions4.resize(nodes);
  for (std::size_t node = 0; node < nodes; ++node) {
    view_mm[node] = kMmPerM * camera.view_m(positions_m[node]);
    positions4[node] = single(view_mm[node], 1);
  }
  nearest_mm = std::numeric_limits<double>::infinity();
  farthest_mm = -nearest_mm;
  for (const EntryFace& face : topology.surface) {
    for (const std::uint32_t node : face.nodes) {
      nearest_mm = std::min(nearest_mm, -view_mm[node].z());
      farthest_mm = std::max(farthest_mm, -view_mm[node].z());
    }
  }
}

void PlacedMesh::place_cells(const Camera& camera) {
  rotations.compute(positions_m, turned);
  const Eigen::Quaterniond to_view(camera.to_view);
  rotations4.resize(turned.size());
  for (std::size_t node = 0; node < turned.size(); ++node) {
    const Eigen::Quaterniond q = to_view * turned[node];
    rotations4[node] = single(q.vec(), q.w());
  }
  proxy_geometry(rest.tetrahedra, view_mm, texture, cells);
}

std::pair<Eigen::Vector2i, Eigen::Vector2i> PlacedMesh::covered(const Scene& scene) const {
  const Eigen::Vector2d size(scene.width, scene.height);
  Eigen::Vector2d least = size, greatest = Eigen::Vector2d::Zero();
  const Camera& camera = scene.camera;
  const double scale = camera.parallel ? kMmPerM : 1;
  // Where a lens shows it is not looked for.
  if (scene.lens) return {Eigen::Vector2i::Zero(), size.cast<int>()};
  for (const EntryFace& face : topology.surface) {
    for (const std::uint32_t node : face.nodes) {
      const Vector3& at = view_mm[node];
      // What is beside or behind the eye may cover anything.
      if (!camera.parallel && at.z() > -1) return {Eigen::Vector2i::Zero(), size.cast<int>()};
      const Eigen::Vector2d ray = at.head<2>() / (camera.parallel ? scale : -at.z());
      const Eigen::Vector2d pixel =
          ((ray - camera.centre).cwiseQuotient(camera.half_extent) + Eigen::Vector2d::Ones())
              .cwiseProduct(size) /
          2;
      least = least.cwiseMin(pixel);
      greatest = greatest.cwiseMax(pixel);
    }
  }
  const auto within = [&](const Eigen::Vector2d& pixel, double more) {
    return Eigen::Vector2i((pixel.array() + more).max(0).min(size.array()).cast<int>());
  };
  const Eigen::Vector2i first = within(least, -1), last = within(greatest, 2);
  return {first, last.cwiseMax(first)};
}

}  // namespace kiroku::sim
