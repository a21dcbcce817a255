// The organ deformed until it falls onto what a picture shows of it: an inverse problem of finite elements.
// Sought are the forces on the organ's surface, its displacement follows; with how well that is determined.
// Functions are pure and thread-safe.
//
// Sought are coefficients q of a DeformableOrgan and a motion m of the camera that minimise
//   sum over points    rho(|pixel seen - pixel of the place under q and m| / s_p) / k_p
// + sum over normals   rho(border seen off the outline under q and m / s_o) / k_o
// + sum over forces    (q / a)^2 + (m - expected)^T C^-1 (m - expected)
// by Gauss and Newton. s are robust scales of the residuals, k says how many residuals are as good as one. At
// first rho lets tissue count that is far from where the fit has it.
//
// Sources: forces as unknowns of an elastic registration, Plantefève, Peterlik, Haouchine and Cotin,
// "Patient-specific Biomechanical Modeling for Guidance during Minimally-invasive Hepatic Surgery" (Annals of
// Biomedical Engineering, 2016); the sizes a of the forces by their evidence, MacKay, "Bayesian
// Interpolation" (Neural Computation, 1992), equation 4.10, for each patch; the outline as outline_fit.h.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "sim/align/colour_model.h"
#include "sim/align/deformable_organ.h"
#include "sim/align/outline_fit.h"

namespace kiroku::sim {

/// Tissue that was followed into the picture, by optical flow or otherwise.
struct TrackedTissue {
  SurfacePlace place;
  Eigen::Vector2d pixel;
};

enum class WhyUnfitted {
  kFitted,
  kNotInPicture,        // hardly any outline is in the picture, or the organ comes beside or behind the eye
  kHidden,              // too little of the outline is free of cover
  kOutlineUnexplained,  // no deformation brings the outline onto a border
  kTissueUnexplained,   // no deformation explains where the tissue went
  kTorn,                // only one that stretches or squeezes the surface beyond what tissue bears
  kNothingTold,         // no place of the organ is determined to kLargestErrorM
};
/// A word for documents: "outline-unexplained".
const char* name_of(WhyUnfitted why);

struct DeformedFitOptions {
  double reach_px = 20;  // how far along a normal the border is sought at first
  int rounds = 8;        // of seeking, each with a shorter reach
  double spacing_px = 6;
  int shrink = 2;  // of the silhouette that is drawn in each round
};

/// All but the figures is of a fit that was not refused for kNotInPicture.
struct DeformedFit {
  /// The least standard error that makes a node's displacement count as not told, m.
  static constexpr double kLargestErrorM = 0.006;

  WhyUnfitted why = WhyUnfitted::kNotInPicture;
  [[nodiscard]] bool fitted() const { return why == WhyUnfitted::kFitted; }

  Eigen::VectorXd coefficients;
  Camera camera;     // before which the organ then is
  OrganShape shape;  // displacements in patient coordinates, against what is fixed
  /// (|S|) of each displacement, m^2: what residuals and expectation leave open, and what the model itself
  /// may be wrong by.
  std::vector<Eigen::Matrix3d> covariance_m2;
  std::vector<bool> seen;  // (|S|), nodes that face the eye in the picture, not covered

  /// Root of the mean squared length of the error of a node's displacement, m.
  [[nodiscard]] double standard_error_m(std::size_t node) const {
    return std::sqrt(covariance_m2[node].trace());
  }
  [[nodiscard]] bool told(std::size_t node) const { return standard_error_m(node) <= kLargestErrorM; }

  Eigen::VectorXd expected;     // a: how many times the force expected beforehand is expected of each now
  double determined = 0;        // so many coefficients the picture determines
  std::size_t lines = 0;        // of the outline in the picture
  double seen_outline = 0;      // share of the lines that are not covered; the next two are of these
  double supported = 0;         // share along which the picture shows a border
  double border_px = 0;         // root of the mean square over the lines that show one
  std::size_t points = 0;       // of tissue, that were given
  double points_agree = 0;      // share of them that the fit explains
  double points_misfit_px = 0;  // root of the mean square over these
};

/// Begins at `pose.camera` with the coefficients `begin` (empty for none); only the pose's covariance says
/// what is expected of the camera. `tissue` may be empty. `model`: the organ's colours from earlier pictures;
/// without, they are taken from this picture in each round.
///
/// The fit is refused where it explains nothing. kiroku::UsageError for coefficients of another count and for
/// places that are not on the surface.
DeformedFit fit_deformed(const ColourCells& cells, const DeformableOrgan& organ, const Pinhole& pinhole,
                         const Expected& pose, const Eigen::VectorXd& begin,
                         const std::vector<TrackedTissue>& tissue, const ColourModel* model,
                         const DeformedFitOptions& options = {});

/// A row of the fit: what is measured of the picture, and its derivative with the coefficients and the
/// motion.
struct PixelDerivative {
  Eigen::Vector2d pixel;
  Eigen::Matrix2Xd by_unknowns;  // (2 x unknowns + 6): coefficients, then Motion
};
/// Of a place on the surface before a camera.
PixelDerivative pixel_derivative(const DeformableOrgan& organ, const OrganShape& shape, const Camera& camera,
                                 const Pinhole& pinhole, const SurfacePlace& place);

}  // namespace kiroku::sim
