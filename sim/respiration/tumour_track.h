// Where a tumour is in each moment of a series of radiographs to which a breathing lung was fitted.
//
// The DRR of the tumour alone (the CT less the lung around it) is laid over each radiograph near where the
// fitted lung has it. At each place the radiograph's differences of neighbouring pixels are explained by
// those of the DRR without the tumour and those of the tumour, both with a factor of their own; the place
// that explains most counts. Whether it does is decided by how it stands out from all others and by whether
// the tumour's factor is that of its surroundings. All places seen together then correct the lung's motion at
// the tumour (a shift, its response to both groups, and a lag), which carries over to moments where it was
// not seen.
#pragma once

#include <vector>

#include "sim/respiration/series_fit.h"

namespace kiroku::sim {

enum class TumourSight : std::uint8_t {
  kSeen,       // in one picture of the moment at least
  kPredicted,  // in none; the lung's motion says where it is
  kLost,       // in none, and the pictures of the moment do not look like the lung: no place is told
};
/// "seen", "predicted", "lost".
const char* name_of(TumourSight sight);

struct TumourMoment {
  double time_s = 0;
  TumourSight sight = TumourSight::kLost;
  std::size_t views_seen = 0;
  /// In the room of the geometries; not for what is lost. The covariance is of the place, m2.
  Vector3 place_m = Vector3::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double stands_out = 0;  // best place against the next best apart from it, of the picture where that is most
};

struct TumourTrack {
  std::vector<TumourMoment> moments;  // as in the fit
  std::size_t seen = 0, predicted = 0, lost = 0;
  /// How far the tumour was seen from where the lung alone has it, and from where the corrected motion has
  /// it; across the ray, root of the mean square of each axis, m. Zero where it was never seen.
  double before_correction_m = 0, after_correction_m = 0;
};

/// The fit must be one (no refusal). kiroku::Error for a model without a tumour.
TumourTrack track_tumour(const BreathingModel& model, const BreathingScene& scene, const Volume& volume,
                         const std::vector<ProjectionGeometry>& views,
                         std::span<const SeriesPicture> pictures, const SeriesFit& fit);

/// "time_s,x_mm,y_mm,z_mm,error_x_mm,error_y_mm,error_z_mm,sight,views_seen" and a line a moment; errors are
/// standard deviations; of what is lost place and errors are empty.
std::string track_csv(const TumourTrack& track);

}  // namespace kiroku::sim
