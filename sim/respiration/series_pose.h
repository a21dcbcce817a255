// How a patient lay while a series of radiographs was taken, before anything is known of the breathing: a
// pattern search on the mean pictures. Thread-safe for scenes of their own.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "sim/respiration/breathing_pictures.h"

namespace kiroku::sim {

struct SeriesPicture {
  double time_s = 0;
  std::size_t view = 0;   // which geometry, from 0
  ProjectionImage image;  // of the geometry's pixels; light where much attenuates
  std::string name;       // for people
};

/// Told what is done, and the parts done of all. What it throws ends the search.
using SeriesProgress = std::function<void(const std::string&, std::size_t, std::size_t)>;

/// Below these a computed picture shows something else than the radiograph, or perhaps does.
inline constexpr double kLeastSimilarity = 0.3, kDoubtfulSimilarity = 0.8;

struct SeriesPose {
  Vector3 translation_m = Vector3::Zero();  // of BreathingScene::middle_m()
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  double similarity_before = 0, similarity_after = 0;  // mean pictures and the CT, as given and as found
  /// In one sentence with its numbers: why the pictures are not of this CT. Empty where they may be.
  std::string refusal;
  std::vector<std::string> findings;
  std::size_t projections = 0;
};

/// `held`: the patient lies as the geometries have them. Then nothing is moved, and a finding tells where the
/// pictures clearly say otherwise.
SeriesPose find_series_pose(const BreathingScene& scene, const std::vector<ProjectionGeometry>& views,
                            std::span<const SeriesPicture> pictures, bool held,
                            const SeriesProgress& progress);

}  // namespace kiroku::sim
