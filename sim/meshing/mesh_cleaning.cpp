#include "sim/meshing/mesh_cleaning.h"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>

#include "sim/mesh/disjoint_sets.h"
#include "sim/mesh/mesh_topology.h"

namespace kiroku::sim {
namespace {

using Edge = std::array<std::uint32_t, 2>;

/// Keeps tetrahedra with `kept`, in their order.
void keep_tetrahedra(TetMesh& mesh, const std::vector<bool>& kept) {
  std::size_t next = 0;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    if (!kept[t]) continue;
    mesh.tetrahedra[next] = mesh.tetrahedra[t];
    mesh.regions[next] = mesh.regions[t];
    ++next;
  }
  mesh.tetrahedra.resize(next);
  mesh.regions.resize(next);
}

void keep_largest_pieces(TetMesh& mesh, std::size_t pieces, Cleaned& cleaned) {
  const Parts parts = face_connected_parts(mesh, faces_of(mesh));
  if (parts.count <= pieces) return;
  std::vector<double> volume_m3(parts.count);
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t)
    volume_m3[parts.of_tetrahedron[t]] += signed_volume_m3(mesh, t);
  std::vector<std::size_t> by_volume(parts.count);
  std::iota(by_volume.begin(), by_volume.end(), std::size_t{0});
  std::ranges::stable_sort(by_volume,
                           [&](std::size_t a, std::size_t b) { return volume_m3[a] > volume_m3[b]; });
  std::vector<bool> keeps(parts.count), kept(mesh.tetrahedra.size());
  for (std::size_t rank = 0; rank < pieces; ++rank) keeps[by_volume[rank]] = true;
  for (std::size_t t = 0; t < kept.size(); ++t) kept[t] = keeps[parts.of_tetrahedron[t]];
  cleaned.islands += parts.count - pieces;
  cleaned.island_tetrahedra += static_cast<std::size_t>(std::ranges::count(kept, false));
  keep_tetrahedra(mesh, kept);
}

/// Edges of the surface in which more than two of its faces meet.
std::vector<Edge> hinge_edges(const Faces& faces) {
  std::map<Edge, std::size_t> uses;
  for (const Face& face : faces.surface) {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [least, greatest] = std::minmax(face.nodes[i], face.nodes[(i + 1) % 3]);
      ++uses[{least, greatest}];
    }
  }
  std::vector<Edge> hinges;
  for (const auto& [edge, count] : uses) {
    if (count > 2) hinges.push_back(edge);
  }
  return hinges;
}

bool has(const Tetrahedron& corners, std::uint32_t node) {
  return std::ranges::find(corners, node) != corners.end();
}

/// Around each hinge removes all groups of tetrahedra that hang together by faces there but the largest by
/// volume. Whether there was one.
bool remove_hinge_edges(TetMesh& mesh, Cleaned& cleaned) {
  const Faces faces = faces_of(mesh);
  const std::vector<Edge> hinges = hinge_edges(faces);
  if (hinges.empty()) return false;
  std::vector<std::vector<std::uint32_t>> around(mesh.nodes.size());  // only of nodes of hinges
  std::vector<bool> wanted(mesh.nodes.size());
  for (const Edge& edge : hinges) wanted[edge[0]] = true;
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (const std::uint32_t node : mesh.tetrahedra[t]) {
      if (wanted[node]) around[node].push_back(t);
    }
  }
  std::vector<bool> kept(mesh.tetrahedra.size(), true);
  for (const Edge& edge : hinges) {
    std::vector<std::uint32_t> at_edge;
    std::ranges::copy_if(around[edge[0]], std::back_inserter(at_edge),
                         [&](std::uint32_t t) { return kept[t] && has(mesh.tetrahedra[t], edge[1]); });
    // Two of them share a face at the edge where they share a third node.
    DisjointSets groups(at_edge.size());
    for (std::uint32_t one = 0; one < at_edge.size(); ++one) {
      for (std::uint32_t other = 0; other < one; ++other) {
        const auto shared = std::ranges::count_if(mesh.tetrahedra[at_edge[one]], [&](std::uint32_t node) {
          return has(mesh.tetrahedra[at_edge[other]], node);
        });
        if (shared > 2) groups.join(one, other);
      }
    }
    std::map<std::uint32_t, double> volume_m3;
    for (std::uint32_t at = 0; at < at_edge.size(); ++at)
      volume_m3[groups.find(at)] += signed_volume_m3(mesh, at_edge[at]);
    if (volume_m3.size() < 2) continue;
    const std::uint32_t largest =
        std::ranges::max_element(volume_m3, {}, [](const auto& group) { return group.second; })->first;
    for (std::uint32_t at = 0; at < at_edge.size(); ++at) {
      if (groups.find(at) != largest) kept[at_edge[at]] = false;
    }
  }
  cleaned.hinge_tetrahedra += static_cast<std::size_t>(std::ranges::count(kept, false));
  keep_tetrahedra(mesh, kept);
  return true;
}

/// A node of its own for each group of tetrahedra that hang together by faces around it; the first keeps the
/// node.
void split_hinge_nodes(TetMesh& mesh, Cleaned& cleaned) {
  DisjointSets corners(4 * mesh.tetrahedra.size());
  for (const auto& [one, other] : faces_of(mesh).between) {
    for (std::uint32_t i = 0; i < 4; ++i) {
      for (std::uint32_t j = 0; j < 4; ++j) {
        if (mesh.tetrahedra[one][i] == mesh.tetrahedra[other][j]) corners.join(4 * one + i, 4 * other + j);
      }
    }
  }
  constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> first_group(mesh.nodes.size(), kNone);
  std::map<std::uint32_t, std::uint32_t> node_of_group;  // of groups that are not the first at their node
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (std::uint32_t i = 0; i < 4; ++i) {
      std::uint32_t& node = mesh.tetrahedra[t][i];
      const std::uint32_t group = corners.find(4 * t + i);
      if (first_group[node] == kNone) first_group[node] = group;
      if (first_group[node] == group) continue;
      const auto [entry, is_new] =
          node_of_group.emplace(group, static_cast<std::uint32_t>(mesh.nodes.size()));
      if (is_new) mesh.nodes.push_back(Vector3(mesh.nodes[node]));
      node = entry->second;
    }
  }
  cleaned.split_nodes += node_of_group.size();
}

void drop_loose_nodes(TetMesh& mesh) {
  const std::vector<bool> used = nodes_in_use(mesh);
  std::vector<std::uint32_t> number(mesh.nodes.size());
  std::uint32_t next = 0;
  for (std::size_t node = 0; node < used.size(); ++node) {
    if (!used[node]) continue;
    mesh.nodes[next] = Vector3(mesh.nodes[node]);
    number[node] = next++;
  }
  mesh.nodes.resize(next);
  for (Tetrahedron& corners : mesh.tetrahedra) {
    for (std::uint32_t& node : corners) node = number[node];
  }
}

}  // namespace

Cleaned clean(TetMesh& mesh, std::size_t pieces) {
  Cleaned cleaned;
  do {
    keep_largest_pieces(mesh, pieces, cleaned);
  } while (remove_hinge_edges(mesh, cleaned));
  split_hinge_nodes(mesh, cleaned);
  drop_loose_nodes(mesh);
  return cleaned;
}

}  // namespace kiroku::sim
