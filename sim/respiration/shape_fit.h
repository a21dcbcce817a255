// Fitting a breathing lung to a second shape of the same lung: a mask from another CT.
//
// Steps, so that what each of them adds can be told:
//  1. the rigid motion between the two patient positions, by all of the surface but the diaphragm;
//  2. the source's model: amplitudes of rib cage and diaphragm (and directions, if asked), with the
//     rigid motion, by least squares of the distances between the surfaces (Levenberg and Marquardt);
//  3. even stretch, beyond the source: each lung stretched as a whole (see stretch_fit.h), as the model's
//     small displacements do not reach a deep breath;
//  4. with correspondences: the smoothest motion that meets them (see correspondences.h);
//  5. sliding boundary: the surface is brought to the second one and is free to slide along it, by elastic
//     energy and surface distances both ways (see sliding_boundary.h). It begins from 4, else from 2,
//     else, where that is clearly nearer to the second surface, from 3.
//
// Source: "Simulating Lung Tumor Motion for Dynamic Tumor-tracking Irradiation" for 2.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "sim/respiration/breathing_model.h"
#include "sim/respiration/correspondences.h"
#include "sim/respiration/landmarks.h"
#include "sim/volume/distance_field.h"

namespace kiroku::sim {

struct ShapeFitOptions {
  bool directions = false;  // both groups may move in any direction: six numbers instead of two
  /// Of all tissue in the third step, -1 < nu < 0.5; the materials' own where absent.
  std::optional<double> poisson_ratio;
  /// Fits the third step again with each quarter of the second surface left out, to tell how far the lung is
  /// from it there: what this step says of places that it has not seen, without landmarks. It begins where
  /// the first two steps end, which have seen them.
  bool cross_validate = false;
  std::optional<Correspondences> correspondences;
};

/// How a step takes the lung to the second CT: a node at x goes to placement (x + displacement).
struct ShapeFitStep {
  std::string name;  // "rigid", "model", "even stretch", "correspondences", "sliding boundary"
  Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();
  Eigen::VectorXd displacement_m;  // (3 |V|)
  Spread surface_m;                // distances of surface nodes to the second surface
  double volume_m3 = 0;            // of the lung as it is then
  std::size_t inverted = 0;        // elements that this turns inside out, as folds of the surface may
};

struct ShapeFitResult {
  BreathingMotion motion;           // the model with what was found; phases are those of the model
  std::vector<ShapeFitStep> steps;  // four, five with correspondences; the last one is the answer
  double first_volume_m3 = 0, second_volume_m3 = 0;
  Spread second_surface_m;  // distances of points all over the second surface to the lung, at the end
  std::optional<CorrespondenceUse> correspondences;
  std::vector<std::string> warnings;
  /// Why the answer is none, with its numbers; empty where it is one.
  std::string refusal;
  std::optional<Spread>
      left_out_m;  // with cross_validate: distances of the second surface where it was left out
};

/// What an answer keeps to: the mask's volume, and the mean distance of its surface from the second one; and
/// no element is inside out.
inline constexpr double kMostVolumeError = 0.02;
inline constexpr double kMostSurfaceM = 0.002;

/// `second`: any label is lung. kiroku::Error for a mask that is empty, or has less than a fifth or more than
/// five times the lung's volume (another organ, or another unit), and what BreathingBody and
/// follow_correspondences() throw. Same input, same bits.
ShapeFitResult fit_shape(const BreathingModel& model, const LabelMap& second, const ShapeFitOptions& options,
                         const std::function<void(const std::string&)>& step = {});

/// The distance that is left at landmarks of the first CT, m; those more than kLandmarkReachM outside the
/// lung are left out and counted.
struct LandmarkErrors {
  LandmarkPairs inside;                                 // that count; all below are in their order
  std::vector<double> before_m;                         // where the lung does not move at all
  std::vector<std::vector<double>> of_step_m;           // of each step
  std::vector<std::vector<Vector3>> vectors_of_step_m;  // the same with direction, second CT's axes
  std::vector<double> depth_m;                          // to the nearest node of the first surface
  std::vector<Vector3> normals;                         // there, outwards, second CT's axes
  std::size_t outside = 0;
};
inline constexpr double kLandmarkReachM = 0.005;
LandmarkErrors errors_at(const LandmarkPairs& landmarks, const TetMesh& mesh,
                         const std::vector<ShapeFitStep>& steps);

}  // namespace kiroku::sim
