// Radiographs as a detector has them, not as a DRR is: rays of four energies, scatter, a detector that blurs,
// quanta that are counted, a couch's rail and a tube that no CT knows.
#pragma once

#include <vector>

#include "sim/drr/mesh_projector.h"
#include "tests/support/other_lung.h"

namespace kiroku::test {

/// What reaches the detector at each pixel, of 1 without a patient.
struct ArrivedRays {
  std::size_t columns = 0, rows = 0;
  std::vector<float> parts;
};

/// Of each moment; tissue keeps its mass where it is stretched. `displacement_m` is (|V|) of `mesh` each.
/// Takes seconds, on all cores.
std::vector<ArrivedRays> fluoroscopy(const sim::Volume& ct, const sim::TetMesh& mesh,
                                     const sim::ProjectionGeometry& geometry,
                                     const std::vector<std::vector<sim::Vector3>>& displacement_m);

/// Line integrals of what was counted with so many quanta a pixel where there is no patient, with the
/// detector's own noise. Where `exposed` is false no rays came: noise alone.
sim::ProjectionImage counted(const ArrivedRays& arrived, double quanta, bool exposed, Chance& chance);

}  // namespace kiroku::test
