// What is done to a mesh whose nodes and tetrahedra keep their numbers: plain data.
#pragma once

#include <cstdint>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

struct MeshChange {
  std::vector<std::uint32_t> moved;    // nodes, ascending
  std::vector<Vector3> positions_m;    // of each of these, from now on
  std::vector<std::uint32_t> removed;  // tetrahedra that are no longer there, ascending
};

}  // namespace kiroku::sim
