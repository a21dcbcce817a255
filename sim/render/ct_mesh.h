// A whole CT as proxy geometry, for pictures without an organ's mesh. Pure, thread-safe.
#pragma once

#include "sim/volume/grid.h"

namespace kiroku::sim {

/// Tetrahedra that fill the box of all voxels' centres, six for each of some 16^3 blocks, so that empty ones
/// can be passed over. Region 0. kiroku::Error for a CT of a single slice.
TetMesh mesh_of(const Grid& grid);

}  // namespace kiroku::sim
