#include "sim/mesh/node_graph.h"

#include <algorithm>

namespace kiroku::sim {

NodeGraph node_graph_of(const TetMesh& mesh) {
  NodeGraph graph;
  // For each node its elements, then the nodes of these that are not before it.
  std::vector<std::size_t> element_begin(mesh.nodes.size() + 1);
  for (const Tetrahedron& corners : mesh.tetrahedra) {
    for (const std::uint32_t node : corners) ++element_begin[node + 1];
  }
  for (std::size_t node = 1; node < element_begin.size(); ++node)
    element_begin[node] += element_begin[node - 1];
  std::vector<std::uint32_t> elements(4 * mesh.tetrahedra.size());
  std::vector<std::size_t> next(element_begin.begin(), element_begin.end() - 1);
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (const std::uint32_t node : mesh.tetrahedra[t]) elements[next[node]++] = t;
  }
  graph.begin.reserve(mesh.nodes.size() + 1);
  graph.begin.push_back(0);
  std::vector<std::uint32_t> last_seen_from(mesh.nodes.size(), static_cast<std::uint32_t>(mesh.nodes.size()));
  for (std::uint32_t node = 0; node < mesh.nodes.size(); ++node) {
    for (std::size_t i = element_begin[node]; i < element_begin[node + 1]; ++i) {
      for (const std::uint32_t other : mesh.tetrahedra[elements[i]]) {
        if (other < node || last_seen_from[other] == node) continue;
        last_seen_from[other] = node;
        graph.rows.push_back(other);
      }
    }
    std::sort(graph.rows.begin() + static_cast<std::ptrdiff_t>(graph.begin.back()), graph.rows.end());
    graph.begin.push_back(graph.rows.size());
  }
  return graph;
}

}  // namespace kiroku::sim
