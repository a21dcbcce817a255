#include "sim/mesh/mesh_topology.h"

#include <algorithm>
#include <limits>
#include <tuple>

#include "sim/mesh/disjoint_sets.h"

namespace kiroku::sim {
namespace {

struct Candidate {
  std::uint32_t middle, greatest;  // nodes besides the least, in whose bucket it is
  std::uint32_t tetrahedron, side;
};

/// Part numbers from the least tetrahedron of each set.
Parts number_parts(DisjointSets& sets, std::size_t tetrahedra) {
  Parts parts;
  parts.of_tetrahedron.resize(tetrahedra);
  for (std::uint32_t t = 0; t < tetrahedra; ++t) {
    const std::uint32_t first = sets.find(t);
    parts.of_tetrahedron[t] =
        first == t ? static_cast<std::uint32_t>(parts.count++) : parts.of_tetrahedron[first];
  }
  return parts;
}

}  // namespace

Faces faces_of(const TetMesh& mesh) {
  // Bucket by the least node, then sort each small bucket.
  std::vector<std::size_t> begin(mesh.nodes.size() + 1);
  const auto sorted_nodes = [&](std::size_t t, std::size_t side) {
    std::array<std::uint32_t, 3> nodes{};
    for (std::size_t i = 0; i < 3; ++i) nodes[i] = mesh.tetrahedra[t][kFaceCorners[side][i]];
    std::ranges::sort(nodes);
    return nodes;
  };
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (std::size_t side = 0; side < 4; ++side) ++begin[sorted_nodes(t, side)[0] + 1];
  }
  for (std::size_t node = 1; node < begin.size(); ++node) begin[node] += begin[node - 1];
  std::vector<Candidate> candidates(4 * mesh.tetrahedra.size());
  std::vector<std::size_t> next(begin.begin(), begin.end() - 1);
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (std::uint32_t side = 0; side < 4; ++side) {
      const auto [least, middle, greatest] = sorted_nodes(t, side);
      candidates[next[least]++] = {middle, greatest, t, side};
    }
  }
  Faces faces;
  for (std::uint32_t least = 0; least < mesh.nodes.size(); ++least) {
    const auto bucket_end = candidates.begin() + static_cast<std::ptrdiff_t>(begin[least + 1]);
    auto one = candidates.begin() + static_cast<std::ptrdiff_t>(begin[least]);
    std::sort(one, bucket_end, [](const Candidate& a, const Candidate& b) {
      return std::tie(a.middle, a.greatest, a.tetrahedron, a.side) <
             std::tie(b.middle, b.greatest, b.tetrahedron, b.side);
    });
    while (one != bucket_end) {
      auto end = one;
      while (end != bucket_end && end->middle == one->middle && end->greatest == one->greatest) ++end;
      if (end - one == 1) {
        Face face{{}, one->tetrahedron};
        for (std::size_t i = 0; i < 3; ++i) {
          face.nodes[i] = mesh.tetrahedra[one->tetrahedron][kFaceCorners[one->side][i]];
        }
        faces.surface.push_back(face);
      } else {
        for (auto other = one + 1; other != end; ++other) {
          faces.between.push_back({one->tetrahedron, other->tetrahedron});
        }
        if (end - one > 2) faces.overcrowded.push_back({least, one->middle, one->greatest});
      }
      one = end;
    }
  }
  return faces;
}

Neighbours neighbours_of(const TetMesh& mesh, const Faces& faces) {
  Neighbours neighbours(mesh.tetrahedra.size());
  for (std::uint32_t t = 0; t < neighbours.size(); ++t) neighbours[t].fill(t);
  const auto corner_outside = [&](std::uint32_t t, std::uint32_t other) {
    std::size_t corner = 0;
    while (std::ranges::find(mesh.tetrahedra[other], mesh.tetrahedra[t][corner]) !=
           mesh.tetrahedra[other].end())
      ++corner;
    return corner;
  };
  for (const auto& [one, other] : faces.between) {
    neighbours[one][corner_outside(one, other)] = other;
    neighbours[other][corner_outside(other, one)] = one;
  }
  return neighbours;
}

Parts face_connected_parts(const TetMesh& mesh, const Faces& faces) {
  DisjointSets sets(mesh.tetrahedra.size());
  for (const auto& [one, other] : faces.between) sets.join(one, other);
  return number_parts(sets, mesh.tetrahedra.size());
}

Parts node_connected_parts(const TetMesh& mesh) {
  constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  DisjointSets sets(mesh.tetrahedra.size());
  std::vector<std::uint32_t> first_at(mesh.nodes.size(), kNone);
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (const std::uint32_t node : mesh.tetrahedra[t]) {
      if (first_at[node] == kNone) {
        first_at[node] = t;
      } else {
        sets.join(first_at[node], t);
      }
    }
  }
  return number_parts(sets, mesh.tetrahedra.size());
}

}  // namespace kiroku::sim
