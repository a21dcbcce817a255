// A box of tetrahedra. Pure, thread-safe.
#pragma once

#include <array>
#include <cstdint>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// Six tetrahedra a cell (Kuhn's subdivision), so that neighbours share faces. Corners at the origin and
/// `size_m`; node (i, j, k) is i + (cells[0] + 1) * (j + (cells[1] + 1) * k); region 0.
TetMesh tet_grid(const std::array<std::uint32_t, 3>& cells, const Vector3& size_m);

}  // namespace kiroku::sim
