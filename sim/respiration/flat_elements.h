// Elements that a motion makes flat or turns inside out, and stiffening them. Functions; thread-safe.
#pragma once

#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// Makes the elements four times as stiff whose volume is below a twentieth of what it was, or inside out,
/// where nodes lie at `places_m` (|V|); whether there are any. `factors` (|T|) are those of their stiffness.
bool stiffen_flat_elements(const TetMesh& mesh, const std::vector<Vector3>& places_m,
                           std::vector<double>& factors);

}  // namespace kiroku::sim
