// Where an error at landmarks comes from, and how small it could be: what the landmarks themselves allow.
// Nothing here feeds a fit. Pure functions, thread-safe.
#pragma once

#include <string>
#include <vector>

#include "sim/respiration/landmarks.h"
#include "sim/respiration/shape_fit.h"

namespace kiroku::sim {

/// Of errors with a name of their own.
struct NamedSpread {
  std::string name;
  Spread spread_m;
};

/// A transform of the first CT to the second that is fitted on the landmarks themselves.
struct LandmarkBound {
  std::string name;
  Spread fitted_m;    // what it leaves where it was fitted, on all of them: the least it can leave
  Spread left_out_m;  // of each landmark by the transform of all others: what it tells of a place between
};
/// "translation", "rigid", "affine", "quadratic" by least squares, and the "thin-plate spline" through all
/// landmarks (Bookstein, IEEE Transactions on Pattern Analysis 11, 1989; kernel r in three dimensions), which
/// leaves nothing where it was fitted. Only those that the landmarks determine with one left out: an affine
/// one needs 5 of them, a quadratic one 11. Empty for fewer than 4.
std::vector<LandmarkBound> landmark_bounds(const LandmarkPairs& pairs);

/// The errors of one step, in parts.
struct LandmarkDecomposition {
  Vector3 mean_m =
      Vector3::Zero();    // where the fit takes the landmarks, less where they are; second CT's axes
  Spread without_mean_m;  // lengths that are left when that is taken away
  Spread along_normal_m, across_m;  // of the surface nearest to each landmark: absolute values, lengths
  std::vector<NamedSpread> by_height, by_depth;  // thirds of the landmarks from feet to head, by depth below
                                                 // the surface; without those that are empty
};
/// kiroku::Error where there is no landmark in the lung.
LandmarkDecomposition decompose(const LandmarkErrors& errors, std::size_t step);

/// Columns x_mm,y_mm,z_mm (first CT), depth_mm below the lung's surface, then of each step the three
/// components of its error (second CT) and its length.
std::string landmark_csv(const LandmarkErrors& errors, const std::vector<ShapeFitStep>& steps);

/// Error over the height in the lung, of each step but "rigid", as an SVG.
std::string landmark_plot(const LandmarkErrors& errors, const std::vector<ShapeFitStep>& steps);

}  // namespace kiroku::sim
