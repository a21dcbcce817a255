// Which nodes share a tetrahedron. Pure, thread-safe.
#pragma once

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// For each node, those it shares a tetrahedron with that do not come before it, itself included, ascending;
/// none for a loose node: rows[begin[node]] to rows[begin[node + 1]].
struct NodeGraph {
  std::vector<std::size_t> begin;  // (|V| + 1)
  std::vector<std::uint32_t> rows;
};
NodeGraph node_graph_of(const TetMesh& mesh);

}  // namespace kiroku::sim
