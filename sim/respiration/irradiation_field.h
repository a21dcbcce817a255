// How much tissue a beam has to cover: one that follows the tumour against one that covers its whole path.
//
// Source: "Simulating Lung Tumor Motion for Dynamic Tumor-tracking Irradiation" compares both volumes. Pure,
// thread-safe.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "sim/respiration/tumour.h"

namespace kiroku::sim {

struct IrradiationField {
  double margin_m = 0;         // around the tumour in both
  double tumour_m3 = 0;        // at rest, without a margin
  double conventional_m3 = 0;  // all places that the tumour comes to, and the margin around them
  double tracking_m3 =
      0;  // the same as seen from the tumour's centre: its shape changes, its path does not count
  [[nodiscard]] double ratio() const { return tracking_m3 / conventional_m3; }
};

/// `displacements_m`: (3 |V|) of each phase, at least one. Volumes are counted in voxels of a twentieth of
/// the tumour, 0.5 to 2 mm. kiroku::Error for a margin that is negative or beyond 0.1 m.
IrradiationField irradiation_field(const TetMesh& mesh, const Tumour& tumour,
                                   const std::vector<Eigen::VectorXd>& displacements_m, double margin_m);

}  // namespace kiroku::sim
