#include "sim/mesh/tet_grid.h"

#include <utility>

namespace kiroku::sim {

TetMesh tet_grid(const std::array<std::uint32_t, 3>& cells, const Vector3& size_m) {
  TetMesh mesh;
  const auto node = [&](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    return i + (cells[0] + 1) * (j + (cells[1] + 1) * k);
  };
  for (std::uint32_t k = 0; k <= cells[2]; ++k) {
    for (std::uint32_t j = 0; j <= cells[1]; ++j) {
      for (std::uint32_t i = 0; i <= cells[0]; ++i) {
        mesh.nodes.emplace_back(size_m.x() * i / cells[0], size_m.y() * j / cells[1],
                                size_m.z() * k / cells[2]);
      }
    }
  }
  // From corner to opposite corner along the axes in each of their six orders; odd orders are turned.
  constexpr std::array<std::array<std::size_t, 3>, 6> kOrders{
      {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}}};
  for (std::uint32_t k = 0; k < cells[2]; ++k) {
    for (std::uint32_t j = 0; j < cells[1]; ++j) {
      for (std::uint32_t i = 0; i < cells[0]; ++i) {
        for (std::size_t order = 0; order < kOrders.size(); ++order) {
          std::array<std::uint32_t, 3> at{i, j, k};
          Tetrahedron corners{node(i, j, k)};
          for (std::size_t step = 0; step < 3; ++step) {
            ++at[kOrders[order][step]];
            corners[step + 1] = node(at[0], at[1], at[2]);
          }
          if (order >= 3) std::swap(corners[2], corners[3]);
          mesh.tetrahedra.push_back(corners);
        }
      }
    }
  }
  mesh.regions.assign(mesh.tetrahedra.size(), 0);
  return mesh;
}

}  // namespace kiroku::sim
