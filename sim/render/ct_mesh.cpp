#include "sim/render/ct_mesh.h"

#include <algorithm>

#include <Eigen/LU>

#include "base/error.h"

namespace kiroku::sim {

TetMesh mesh_of(const Grid& grid) {
  std::array<std::uint32_t, 3> blocks{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (grid.size[axis] < 2)
      throw Error("a CT of a single slice has no volume that could be shown; give more of its slices");
    constexpr std::size_t kMostBlocks = 16;
    blocks[axis] = static_cast<std::uint32_t>(std::min(kMostBlocks, grid.size[axis] - 1));
  }
  TetMesh mesh;
  const auto node = [&](const std::array<std::uint32_t, 3>& at) {
    return at[0] + (blocks[0] + 1) * (at[1] + (blocks[1] + 1) * at[2]);
  };
  std::array<std::uint32_t, 3> at{};
  for (at[2] = 0; at[2] <= blocks[2]; ++at[2]) {
    for (at[1] = 0; at[1] <= blocks[1]; ++at[1]) {
      for (at[0] = 0; at[0] <= blocks[0]; ++at[0]) {
        Vector3 index;
        for (std::size_t axis = 0; axis < 3; ++axis)
          index[static_cast<Eigen::Index>(axis)] = double(grid.size[axis] - 1) * at[axis] / blocks[axis];
        mesh.nodes.push_back(grid.patient_m(index));
      }
    }
  }
  // Kuhn's subdivision: from corner to opposite corner along the axes in each of their six orders.
  std::array<std::size_t, 3> order{0, 1, 2};
  const bool mirrored = grid.direction.determinant() < 0;
  do {
    for (at[2] = 0; at[2] < blocks[2]; ++at[2]) {
      for (at[1] = 0; at[1] < blocks[1]; ++at[1]) {
        for (at[0] = 0; at[0] < blocks[0]; ++at[0]) {
          std::array<std::uint32_t, 3> corner = at;
          Tetrahedron corners{node(corner)};
          for (std::size_t step = 0; step < 3; ++step) {
            ++corner[order[step]];
            corners[step + 1] = node(corner);
          }
          const bool odd = (order[1] + 3 - order[0]) % 3 == 2;
          if (odd != mirrored) std::swap(corners[2], corners[3]);
          mesh.tetrahedra.push_back(corners);
        }
      }
    }
  } while (std::next_permutation(order.begin(), order.end()));
  mesh.regions.assign(mesh.tetrahedra.size(), 0);
  return mesh;
}

}  // namespace kiroku::sim
