// What refinement leaves over and no solver can live with. Pure, thread-safe.
#pragma once

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

struct Cleaned {
  std::size_t islands = 0, island_tetrahedra = 0;  // parts that share no face with those kept, removed
  std::size_t hinge_tetrahedra = 0;                // removed where the body hung together by an edge alone
  std::size_t split_nodes = 0;  // where it hung together by a node alone: made one node for each side
};

/// Keeps the `pieces` largest parts by volume (of equal ones the first) that hang together by whole faces.
/// Where tetrahedra meet in an edge or a node only, the surface passes through itself: at an edge the smaller
/// side goes, at a node each side gets its own. Nodes of no tetrahedron go; the others keep their order.
///
/// Afterwards check_mesh() finds neither loose nodes nor hinges, and as many pieces as were kept.
Cleaned clean(TetMesh& mesh, std::size_t pieces);

}  // namespace kiroku::sim
