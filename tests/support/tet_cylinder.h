// A cylinder of tetrahedra: rings around its axis, layers along it.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::test {

/// Along z from the origin; 3 rings (rings + 1) + 1 nodes in each of layers + 1 planes, node 0 of each on the
/// axis; region 0.
inline sim::TetMesh tet_cylinder(std::uint32_t rings, std::uint32_t layers, double radius_m,
                                 double length_m) {
  sim::TetMesh mesh;
  const std::uint32_t in_plane = 3 * rings * (rings + 1) + 1;
  const auto node = [](std::uint32_t ring, std::uint32_t i) {  // ring r has 6 r nodes
    return ring == 0 ? 0 : 3 * ring * (ring - 1) + 1 + i % (6 * ring);
  };
  for (std::uint32_t layer = 0; layer <= layers; ++layer) {
    const double z_m = length_m * layer / layers;
    mesh.nodes.emplace_back(0, 0, z_m);
    for (std::uint32_t ring = 1; ring <= rings; ++ring) {
      for (std::uint32_t i = 0; i < 6 * ring; ++i) {
        const double angle = 2 * std::numbers::pi * i / (6 * ring), distance_m = radius_m * ring / rings;
        mesh.nodes.emplace_back(distance_m * std::cos(angle), distance_m * std::sin(angle), z_m);
      }
    }
  }
  const auto add_prisms = [&](std::array<std::uint32_t, 3> corners) {
    // Cut along the diagonals that go up from the lower number, so that neighbours share faces.
    std::ranges::sort(corners);
    const auto [a, b, c] = corners;
    for (std::uint32_t layer = 0; layer < layers; ++layer) {
      const std::uint32_t below = layer * in_plane, above = below + in_plane;
      for (sim::Tetrahedron tetrahedron : {sim::Tetrahedron{below + a, below + b, below + c, above + c},
                                           sim::Tetrahedron{below + a, below + b, above + b, above + c},
                                           sim::Tetrahedron{below + a, above + a, above + b, above + c}}) {
        mesh.tetrahedra.push_back(tetrahedron);
        if (sim::signed_volume_m3(mesh, mesh.tetrahedra.size() - 1) < 0)
          std::swap(mesh.tetrahedra.back()[2], mesh.tetrahedra.back()[3]);
      }
    }
  };
  for (std::uint32_t ring = 1; ring <= rings; ++ring) {
    for (std::uint32_t sixth = 0; sixth < 6; ++sixth) {
      for (std::uint32_t i = 0; i < ring; ++i) {
        const std::uint32_t outer = sixth * ring + i, inner = sixth * (ring - 1) + i;
        add_prisms({node(ring, outer), node(ring, outer + 1), node(ring - 1, inner)});
        if (i + 1 < ring)
          add_prisms({node(ring - 1, inner), node(ring - 1, inner + 1), node(ring, outer + 1)});
      }
    }
  }
  mesh.regions.assign(mesh.tetrahedra.size(), 0);
  return mesh;
}

}  // namespace kiroku::test
