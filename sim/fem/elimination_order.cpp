#include "sim/fem/elimination_order.h"

#include <algorithm>

#include "sim/fem/cholmod_handles.h"
#include "sim/mesh/node_graph.h"

namespace kiroku::sim {

std::vector<std::uint32_t> elimination_order(const TetMesh& mesh) {
  CholmodSession session;
  const NodeGraph nodes = node_graph_of(mesh);
  const CholmodSession::Sparse graph = session.allocate_pattern(mesh.nodes.size(), nodes.rows.size());
  std::ranges::copy(nodes.begin, static_cast<std::int64_t*>(graph->p));
  std::ranges::copy(nodes.rows, static_cast<std::int64_t*>(graph->i));
  std::vector<std::int64_t> order(mesh.nodes.size());
  cholmod_l_metis(graph.get(), nullptr, 0, 1, order.data(), session.common());
  session.check();
  return {order.begin(), order.end()};
}

}  // namespace kiroku::sim
