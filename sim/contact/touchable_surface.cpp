#include "sim/contact/touchable_surface.h"

#include <Eigen/Geometry>

#include "sim/contact/point_tree.h"
#include "sim/fem/compliance.h"
#include "sim/mesh/mesh_topology.h"

namespace kiroku::sim {

static_assert(PointTree::kLeaf == Compliance::kGroupSize, "leaves of the tree are groups of columns");

TouchableSurface::TouchableSurface(const ElasticBody& body)
    : place_of(body.mesh().nodes.size(), kNowhere), size_m(extent_of(body.mesh()).longest_side_m()) {
  const TetMesh& mesh = body.mesh();
  std::vector<double> area_of_node_m2(mesh.nodes.size());
  std::vector<std::uint32_t> touchable;
  for (const Face& face : faces_of(mesh).surface) {
    const Vector3& a = mesh.nodes[face.nodes[0]];
    const double third_m2 =
        (mesh.nodes[face.nodes[1]] - a).cross(mesh.nodes[face.nodes[2]] - a).norm() / 2 / 3;
    for (const std::uint32_t node : face.nodes) {
      area_of_node_m2[node] += third_m2;
      if (place_of[node] != kNowhere || body.free_components(node) == 0) continue;
      place_of[node] = 0;
      touchable.push_back(node);
    }
  }
  for (const auto& group : neighbouring_groups(mesh.nodes, touchable, PointTree::kLeaf))
    nodes.insert(nodes.end(), group.begin(), group.end());
  for (std::uint32_t place = 0; place < nodes.size(); ++place) {
    const std::uint32_t node = nodes[place];
    place_of[node] = place;
    area_m2.push_back(area_of_node_m2[node]);
    free.push_back(body.free_components(node) == 3 ? 1 : 0);
  }
}

}  // namespace kiroku::sim
