// Fitting a breathing lung to a series of radiographs, by the pictures themselves.
//
// For each moment of the series how far rib cage and diaphragm have moved is sought, and for all of it how
// the patient lies (and, if asked, where the diaphragm moves to), so that gradient correlation (Penney et
// al., IEEE Transactions on Medical Imaging 17(4), 1998) becomes greatest: Gauss-Newton steps on all unknowns
// at once, the moments' own eliminated from the equations first, in pixels that become smaller. Amplitude,
// phase, baseline and drift of both groups are then those of the waveform that is nearest to what was found,
// so that a breath unlike the others does not pull at the patient's pose. Start: a pattern search on the mean
// pictures.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sim/respiration/series_pose.h"
#include "sim/respiration/wave_fit.h"

namespace kiroku::sim {

struct SeriesFitOptions {
  /// The diaphragm's direction is sought, too, from the model's or from straight down.
  bool direction = false;
  /// The patient lies as the geometries have them: only the breathing is sought.
  bool lies_as_given = false;
  SeriesProgress progress;
};

/// Pictures that were taken at the same time.
struct SeriesMoment {
  double time_s = 0;
  std::vector<std::size_t> pictures;
  BreathState state;                                         // as its pictures say
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();  // of rib cage and diaphragm, m2
  double similarity = 0;                                     // mean gradient correlation of its pictures
};

struct SeriesFit {
  BreathingMotion motion;
  Waveform waveform{SineWave{}};  // the model's; of a sine the cycle that was found
  /// Of a sine whose cycle was sought in the diaphragm's motion; nothing where it is the model's own.
  std::optional<CycleFit> cycle;
  WaveFit rib_cage, diaphragm;
  /// From where the CT has the patient to where they lay; about BreathingScene::middle_m().
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  Vector3 translation_m = Vector3::Zero(), rotation_rad = Vector3::Zero();
  /// Of translation and rotation, by how the pictures' wishes differ (each picture one vote): their scatter
  /// alone, which is far smaller than the error of the pose.
  Eigen::Matrix<double, 6, 6> pose_covariance = Eigen::Matrix<double, 6, 6>::Zero();
  /// Of the same, as one moment tells them: what the model does not explain of the pictures is much the same
  /// in all of them, so more moments do not make the pose surer. Zero where it was given.
  Eigen::Matrix<double, 6, 6> pose_uncertainty = Eigen::Matrix<double, 6, 6>::Zero();
  std::vector<SeriesMoment> moments;
  double similarity_before = 0;  // mean pictures and the CT as it lies
  double similarity_posed = 0;   // and as the patient was found to lie, without breathing
  double similarity_after = 0;   // mean of all pictures
  /// How alike the change of the pictures from their mean is to that of the DRRs by the waveform alone
  /// (correlation of gradients), and the root mean square that the same DRRs reach in other orders.
  double change = 0, change_by_chance = 0;
  /// In one sentence with its numbers: why this is no fit. Empty where it is one.
  std::string refusal;
  std::vector<std::string> findings;
  std::size_t projections = 0;
};

/// Moments that a series needs at least.
inline constexpr std::size_t kLeastMoments = 8;

/// Turns the scene's diaphragm where a direction is sought. kiroku::Error for fewer than kLeastMoments, a
/// picture of another size than its geometry (naming it), a view without pictures, and what the scene throws.
/// What does not fit is no error but a refusal.
SeriesFit fit_series(const BreathingModel& model, BreathingScene& scene,
                     const std::vector<ProjectionGeometry>& views, std::span<const SeriesPicture> pictures,
                     const SeriesFitOptions& options = {});

}  // namespace kiroku::sim
