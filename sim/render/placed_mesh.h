// A mesh as a picture finds it: where its nodes are, how they have turned, and each tetrahedron's way into
// the CT. Both engines draw from it. Belongs to the thread that made it.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "sim/render/gl_vector.h"
#include "sim/render/proxy_geometry.h"
#include "sim/render/scene.h"
#include "sim/render/vertex_rotations.h"

namespace kiroku::sim {

struct PlacedMesh {
  /// Copies the mesh. kiroku::Error as proxy_topology().
  explicit PlacedMesh(const TetMesh& rest_mesh);

  TetMesh rest;
  ProxyTopology topology;
  VertexRotations rotations;
  std::vector<Vector3> texture;  // (|V|), initial coordinates; filled by who knows the CT

  // Of the picture that is being made; kept for their memory.
  std::vector<Vector3> positions_m, view_mm;
  std::vector<Eigen::Quaterniond> turned;
  std::vector<CellGeometry> cells;
  std::vector<Float4> positions4, rotations4;  // (|V|), in the view's axes, mm; (x, y, z, w)
  double nearest_mm = 0, farthest_mm = 1;      // of the surface, along the view

  /// Where the nodes are: positions_m, view_mm, positions4, nearest_mm, farthest_mm. `displacement_m`: (3
  /// |V|), or empty for none.
  void place_nodes(std::span<const double> displacement_m, const Camera& camera);
  /// What rays need beside it, by far the longer part: turned, rotations4 and cells. After place_nodes() with
  /// the same camera.
  void place_cells(const Camera& camera);
  /// The pixels that the mesh may cover: from the first on, up to but without the second. Rows from below.
  [[nodiscard]] std::pair<Eigen::Vector2i, Eigen::Vector2i> covered(const Scene& scene) const;
};

}  // namespace kiroku::sim
