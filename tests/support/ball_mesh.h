// An ellipsoid of tetrahedra, and what a CT would show of one.
#pragma once

#include <cmath>

#include "sim/volume/volume.h"
#include "tests/support/tet_grid.h"

namespace kiroku::test {

/// tet_grid(cells) pulled onto the ellipsoid; the grid's corners lie on it too.
inline sim::TetMesh ball_mesh(const std::array<std::uint32_t, 3>& cells, const sim::Vector3& middle_m,
                              const sim::Vector3& half_m) {
  sim::TetMesh mesh = tet_grid(cells, sim::Vector3::Constant(2));
  for (sim::Vector3& node : mesh.nodes) {
    const sim::Vector3 c = node - sim::Vector3::Ones(), s = c.cwiseProduct(c);
    const sim::Vector3 in_ball(c.x() * std::sqrt(1 - s.y() / 2 - s.z() / 2 + s.y() * s.z() / 3),
                               c.y() * std::sqrt(1 - s.z() / 2 - s.x() / 2 + s.z() * s.x() / 3),
                               c.z() * std::sqrt(1 - s.x() / 2 - s.y() / 2 + s.x() * s.y() / 3));
    node = middle_m + in_ball.cwiseProduct(half_m);
  }
  return mesh;
}

/// HU by a function of the place in m.
template <typename Hu>
sim::Volume volume_of(const std::array<std::size_t, 3>& size, double spacing_m, const sim::Vector3& origin_m,
                      const Hu& hu) {
  sim::Volume volume;
  volume.grid.size = size;
  volume.grid.spacing_m = sim::Vector3::Constant(spacing_m);
  volume.grid.origin_m = origin_m;
  volume.hu.reserve(volume.grid.voxels());
  for (std::size_t k = 0; k < size[2]; ++k) {
    for (std::size_t j = 0; j < size[1]; ++j) {
      for (std::size_t i = 0; i < size[0]; ++i)
        volume.hu.push_back(static_cast<float>(hu(volume.grid.patient_m({double(i), double(j), double(k)}))));
    }
  }
  return volume;
}

}  // namespace kiroku::test
