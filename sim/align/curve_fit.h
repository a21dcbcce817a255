// The camera that makes curves of the organ fall onto curves that were drawn in a picture, by a person or by
// a program that finds them: parts of the organ's outline, and lines that are marked on its surface, such as
// a liver's lower ridge and the line along which a ligament is attached. Nobody says which point of a line is
// which of its curve. A curve may be any part of an outline, and end at the picture's border. Functions are
// pure and thread-safe.
//
// Source: closest points as Besl and McKay, "A Method for Registration of 3-D Shapes" (PAMI 1992), whose
// distances are taken along a curve's normal, as Chen and Medioni, "Object Modelling by Registration of
// Multiple Range Images" (Image and Vision Computing 1992); solved by Levenberg and Marquardt. Ridge,
// ligament and silhouette as what is seen of a liver: Koo, Özgür, Le Roy, Buc and Bartoli, "Deformable
// Registration of a Preoperative 3D Liver Volume to a Laparoscopy Image Using Contour and Shading Cues"
// (MICCAI 2017).
#pragma once

#include <optional>
#include <vector>

#include "sim/align/search_range.h"
#include "sim/align/silhouette.h"

namespace kiroku::sim {

struct DrawnCurve {
  std::vector<Eigen::Vector2d> pixels;  // a polyline, at least two places
  /// The line on the organ that the curve shows, from either end, patient coordinates, at least two places;
  /// empty for a curve that is a part of the organ's outline.
  std::vector<Vector3> line_m;
};

struct CurveFitOptions {
  double spacing_px = 12;  // between the places of a curve at which it is compared
  int most_rounds = 80;
  int shrink = 4;  // of the silhouette that is drawn for curves of the outline
};

struct CurveFit {
  Camera camera;
  /// What the residuals leave open, as many as they say of themselves. Errors that the organ's shape makes,
  /// as where it lies deformed, show in the residuals and may still be larger than this.
  MotionCovariance covariance_m2 = MotionCovariance::Zero();
  std::vector<double> curve_px;  // of each curve: root of the mean squared distance
  double misfit_px = 0;          // root of the mean of their squares: each curve counts alike
};

/// Begins at `begin`. Distances count both ways between a curve and the line that it shows, and from a curve
/// of the outline to the outline; what of an outline nobody drew counts for nothing, as something may hide
/// it. An outline farther off than half of the picture's lesser side counts as that far.
///
/// Nothing is returned where a line comes beside or behind the eye, or the organ where a curve of its outline
/// is given. kiroku::UsageError for no curve, and curves or lines of less than two places or of no length.
std::optional<CurveFit> fit_curves(const OrganSurface& surface, const Pinhole& pinhole, int width, int height,
                                   const Camera& begin, const std::vector<DrawnCurve>& curves,
                                   const CurveFitOptions& options = {});

/// From any place in the range, the best first; those that are the same are there once. As where the organ is
/// comes from the lines, at least one curve must have one: kiroku::UsageError, also as fit_curves(). Works on
/// as many threads as the machine has cores; what it finds does not depend on their number.
std::vector<CurveFit> find_curves(const OrganSurface& surface, const SearchRange& range,
                                  const Pinhole& pinhole, int width, int height,
                                  const std::vector<DrawnCurve>& curves, const CurveFitOptions& options = {});

/// The places of the outline as that camera has it, in the picture and around it by half of its lesser side;
/// nothing where a part of the organ is beside or behind the eye.
std::optional<std::vector<OutlinePoint>> outline_around(const OrganSurface& surface, const Camera& camera,
                                                        const Pinhole& pinhole, int width, int height,
                                                        double spacing_px, int shrink);

}  // namespace kiroku::sim
