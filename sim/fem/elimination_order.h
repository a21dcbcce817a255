// In which order the nodes of a mesh are eliminated, so that the factor stays small: nested dissection by
// METIS. Pure, thread-safe; the same mesh gives the same order.
#pragma once

#include <cstdint>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// All nodes of the mesh, the first to be eliminated first. Which of them are fixed need not be known: the
/// order stays good without them.
std::vector<std::uint32_t> elimination_order(const TetMesh& mesh);

}  // namespace kiroku::sim
