// The camera that makes the organ's outline fall onto the border that the picture shows, with how well that
// is determined. Functions are pure and thread-safe.
//
// Source: the border is sought along the outline's normals (border.h); solved by Gauss and Newton with
// Tukey's weights.
#pragma once

#include <optional>

#include "sim/align/colour_model.h"
#include "sim/align/organ_surface.h"
#include "sim/render/picture.h"

namespace kiroku::sim {

/// Where the organ is thought to be before the picture is looked at.
struct Expected {
  Camera camera;
  MotionCovariance covariance_m2;
};

struct OutlineFitOptions {
  double reach_px = 16;  // how far along a normal the border is sought at first
  int rounds = 6;        // of seeking, each with a shorter reach
  double spacing_px = 6;
  int shrink = 2;  // of the silhouette that is drawn in each round
};

struct OutlineFit {
  Camera camera;
  MotionCovariance covariance_m2;
  std::size_t lines = 0;        // of the outline in the picture
  double share_in_picture = 0;  // of the whole outline
  double seen = 0;              // share of the lines that are not covered; those below are of the seen
  double supported = 0;         // share of the lines along which the picture shows a border
  double misfit_px = 0;  // root of the mean square over all lines, those without a border count as kWorstPx
  double border_px = 0;  // the same over the lines that show a border alone
  double agreement = 0;  // share of the silhouette not covered whose colour is rather the organ's
  double step_m = 0;     // how far the last round still moved the organ
};

inline constexpr double kWorstPx = 8;

/// Begins at expected.camera. Nothing is returned where the organ's outline is hardly in the picture, or the
/// organ comes beside or behind the eye. `model`: of earlier pictures; without, the colours are taken from
/// this picture, anew in each round.
///
/// A line is covered where it shows no border and cover hides much of it. It neither counts for a camera nor
/// against one; what it would have determined stays open, which the covariance says.
///
/// The covariance is that of the residuals over their derivatives, times how far neighbouring residuals say
/// the same, and more for what no residual shows: that the border as a whole is seen too far outside or
/// inside. Joined with the expected one, each direction is as well known as by the better of the two, and no
/// better (the largest ellipsoid within both: Benaskeur, "Consistent Fusion of Correlated Data Sources",
/// IECON 2002), as errors of an outline are alike in successive pictures. So what the outline does not
/// determine keeps the uncertainty of the expectation.
std::optional<OutlineFit> fit_outline(const ColourCells& cells, const OrganSurface& surface,
                                      const Pinhole& pinhole, const Expected& expected,
                                      const ColourModel* model, const OutlineFitOptions& options = {});

}  // namespace kiroku::sim
