#include "sim/mesh/mesh_check.h"

#include <algorithm>
#include <cmath>

#include "sim/mesh/disjoint_sets.h"

namespace kiroku::sim {
namespace {

/// Collects what has one fault, and names the first of them.
class Culprits {
 public:
  void add(const std::string& name) {
    if (count_ < kMostNamed) names_ += (names_.empty() ? "" : ", ") + name;
    ++count_;
  }
  void add(std::size_t number) { add(std::to_string(number)); }

  /// `one` and `many` follow the count: "tetrahedron is flat", "tetrahedra are flat".
  void report(MeshFault fault, const std::string& one, const std::string& many,
              std::vector<MeshFinding>& findings) const {
    if (count_ == 0) return;
    findings.push_back({fault, count_,
                        std::to_string(count_) + " " + (count_ == 1 ? one : many) + ": " + names_ +
                            (count_ > kMostNamed ? ", ..." : "")});
  }

 private:
  std::size_t count_ = 0;
  std::string names_;
};

template <std::size_t Count>
std::string joined(const std::array<std::uint32_t, Count>& nodes) {
  std::string text;
  for (const std::uint32_t node : nodes) text += (text.empty() ? "" : "-") + std::to_string(node);
  return text;
}

bool is_flat(const TetMesh& mesh, std::size_t tetrahedron, double volume_m3) {
  double longest_m = 0;
  const Tetrahedron& corners = mesh.tetrahedra[tetrahedron];
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      longest_m = std::max(longest_m, (mesh.nodes[corners[i]] - mesh.nodes[corners[j]]).norm());
    }
  }
  return !(6 * std::abs(volume_m3) > kFlatRatio * longest_m * longest_m * longest_m);
}

void check_shapes(const TetMesh& mesh, std::vector<MeshFinding>& findings) {
  Culprits inverted, flat;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    const double volume_m3 = signed_volume_m3(mesh, t);
    if (is_flat(mesh, t, volume_m3)) {
      flat.add(t);
    } else if (volume_m3 < 0) {
      inverted.add(t);
    }
  }
  inverted.report(MeshFault::kInvertedTetrahedron, "tetrahedron is inverted", "tetrahedra are inverted",
                  findings);
  flat.report(MeshFault::kFlatTetrahedron, "tetrahedron is flat", "tetrahedra are flat", findings);
}

/// Edges in which more than two faces of the surface meet.
void check_edges(const Faces& faces, std::vector<MeshFinding>& findings) {
  std::vector<std::array<std::uint32_t, 2>> edges;
  edges.reserve(3 * faces.surface.size());
  for (const Face& face : faces.surface) {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [least, greatest] = std::minmax(face.nodes[i], face.nodes[(i + 1) % 3]);
      edges.push_back({least, greatest});
    }
  }
  std::ranges::sort(edges);
  Culprits crowded;
  for (auto one = edges.begin(); one != edges.end();) {
    const auto end = std::find_if(one, edges.end(), [&](const auto& edge) { return edge != *one; });
    if (end - one > 2) crowded.add(joined(*one));
    one = end;
  }
  crowded.report(MeshFault::kNonManifoldEdge, "edge of the surface has more than two faces",
                 "edges of the surface have more than two faces", findings);
}

/// Nodes around which tetrahedra hang together in more than one group.
void check_nodes(const TetMesh& mesh, const Faces& faces, std::vector<MeshFinding>& findings) {
  // Every tetrahedron has one entry at each of its nodes; entries that share a face at that node are joined.
  DisjointSets corners(4 * mesh.tetrahedra.size());
  for (const auto& [one, other] : faces.between) {
    for (std::uint32_t i = 0; i < 4; ++i) {
      for (std::uint32_t j = 0; j < 4; ++j) {
        if (mesh.tetrahedra[one][i] == mesh.tetrahedra[other][j]) corners.join(4 * one + i, 4 * other + j);
      }
    }
  }
  std::vector<std::uint32_t> groups(mesh.nodes.size());
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (std::uint32_t i = 0; i < 4; ++i) {
      if (corners.find(4 * t + i) == 4 * t + i) ++groups[mesh.tetrahedra[t][i]];
    }
  }
  Culprits hinges;
  for (std::size_t node = 0; node < groups.size(); ++node) {
    if (groups[node] > 1) hinges.add(node);
  }
  hinges.report(MeshFault::kNonManifoldNode, "node joins tetrahedra that share no face around it",
                "nodes join tetrahedra that share no face around them", findings);
}

void check_pieces(const TetMesh& mesh, std::vector<MeshFinding>& findings) {
  const Parts parts = node_connected_parts(mesh);
  if (parts.count < 2) return;
  std::vector<std::size_t> sizes(parts.count), first_node(parts.count);
  for (std::size_t t = mesh.tetrahedra.size(); t-- > 0;) {
    ++sizes[parts.of_tetrahedron[t]];
    first_node[parts.of_tetrahedron[t]] = mesh.tetrahedra[t][0];
  }
  std::string names;
  for (std::size_t part = 0; part < std::min(parts.count, kMostNamed); ++part) {
    names += (part == 0 ? "" : ", ") + std::to_string(sizes[part]) +
             (sizes[part] == 1 ? " tetrahedron" : " tetrahedra") + " with node " +
             std::to_string(first_node[part]);
  }
  findings.push_back({MeshFault::kSeveralPieces, parts.count,
                      "the mesh is in " + std::to_string(parts.count) + " pieces: " + names +
                          (parts.count > kMostNamed ? ", ..." : "")});
}

}  // namespace

std::vector<MeshFinding> check_for_solving(const TetMesh& mesh, const Faces& faces) {
  std::vector<MeshFinding> findings;
  check_shapes(mesh, findings);
  Culprits crowded;
  for (const auto& nodes : faces.overcrowded) crowded.add(joined(nodes));
  crowded.report(MeshFault::kCrowdedFace, "face belongs to more than two tetrahedra",
                 "faces belong to more than two tetrahedra", findings);
  return findings;
}

std::vector<MeshFinding> check_mesh(const TetMesh& mesh) {
  const Faces faces = faces_of(mesh);
  std::vector<MeshFinding> findings = check_for_solving(mesh, faces);
  Culprits loose;
  const std::vector<bool> used = nodes_in_use(mesh);
  for (std::size_t node = 0; node < used.size(); ++node) {
    if (!used[node]) loose.add(node);
  }
  loose.report(MeshFault::kLooseNode, "node belongs to no tetrahedron", "nodes belong to no tetrahedron",
               findings);
  check_pieces(mesh, findings);
  check_edges(faces, findings);
  check_nodes(mesh, faces, findings);
  return findings;
}

bool prevents_solving(MeshFault fault) {
  return fault == MeshFault::kInvertedTetrahedron || fault == MeshFault::kFlatTetrahedron ||
         fault == MeshFault::kCrowdedFace;
}

}  // namespace kiroku::sim
