#include "sim/respiration/flat_elements.h"

namespace kiroku::sim {

bool stiffen_flat_elements(const TetMesh& mesh, const std::vector<Vector3>& places_m,
                           std::vector<double>& factors) {
  constexpr double kFlat = 0.05, kStiffer = 4;
  TetMesh moved = mesh;
  moved.nodes = places_m;
  bool any = false;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    if (signed_volume_m3(moved, t) > kFlat * signed_volume_m3(mesh, t)) continue;
    factors[t] *= kStiffer;
    any = true;
  }
  return any;
}

}  // namespace kiroku::sim
