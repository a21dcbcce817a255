// The surface of a lung mesh as its breathing needs it: nodes, outward normals, areas, who lies beside whom.
// Pure, thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "sim/mesh/mesh_topology.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// Rows are nodes of the surface, in ascending order of their number in the mesh; |S| of them.
struct LungSurface {
  std::vector<std::uint32_t> nodes;  // (|S|)
  std::vector<std::int64_t> row_of;  // (|V|), -1 for nodes inside
  std::vector<Vector3> normals;      // (|S|), of length 1, outwards: mean of the faces', by area
  std::vector<double> areas_m2;      // (|S|), a third of each face around
  std::vector<std::array<std::uint32_t, 3>> faces;     // rows, anticlockwise from outside
  std::vector<std::vector<std::uint32_t>> neighbours;  // (|S|), rows that share an edge, ascending
};

/// A node whose faces cancel each other (the surface touches itself there) has the normal of its largest
/// face.
LungSurface surface_of(const TetMesh& mesh);

/// The normals of the same surface when its nodes are elsewhere; `positions_m` (|V|).
std::vector<Vector3> normals_at(const LungSurface& surface, const std::vector<Vector3>& positions_m);

}  // namespace kiroku::sim
