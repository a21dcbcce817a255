// A body as tetrahedra, and its measures. Plain data; functions are pure and thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace kiroku::sim {

using Vector3 = Eigen::Vector3d;

/// The four nodes of an element, by their number from 0.
using Tetrahedron = std::array<std::uint32_t, 4>;

/// |V| nodes, |T| tetrahedra. Nodes that belong to no tetrahedron are kept, so that numbers stay those of the
/// file.
struct TetMesh {
  std::vector<Vector3> nodes;           // (|V|), m
  std::vector<Tetrahedron> tetrahedra;  // (|T|), each with a positive signed_volume_m3() where it is sound
  std::vector<std::int32_t> regions;    // (|T|), the material each is of
};

/// (b - a) x (c - a) . (d - a) / 6 of the nodes a, b, c, d.
double signed_volume_m3(const TetMesh& mesh, std::size_t tetrahedron);

struct Extent {
  Vector3 least = Vector3::Zero(), greatest = Vector3::Zero();  // m
  [[nodiscard]] double longest_side_m() const { return (greatest - least).maxCoeff(); }
};
/// Of all nodes, loose ones too; zero for none.
Extent extent_of(const TetMesh& mesh);

/// Whether each node belongs to a tetrahedron; (|V|).
std::vector<bool> nodes_in_use(const TetMesh& mesh);

/// The regions that occur, ascending, each once.
std::vector<std::int32_t> regions_of(const TetMesh& mesh);

}  // namespace kiroku::sim
