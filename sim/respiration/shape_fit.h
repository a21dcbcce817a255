// Fitting a breathing lung to a second shape of the same lung: a mask from another CT.
//
// Three steps, each from the one before, so that what each of them adds can be told:
//  1. the rigid motion between the two patient positions, by all of the surface but the diaphragm;
//  2. the source's model: amplitudes of rib cage and diaphragm (and directions, if asked), with the
//     rigid motion, by least squares of the distances between the surfaces (Levenberg and Marquardt);
//  3. sliding boundary, beyond the source: the surface is brought to the second one and is free to
//     slide along it, by elastic energy and surface distances both ways (see sliding_boundary.h).
//
// Source: "Simulating Lung Tumor Motion for Dynamic Tumor-tracking Irradiation" for 2.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "sim/respiration/breathing_model.h"
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
};

/// How a step takes the lung to the second CT: a node at x goes to placement (x + displacement).
struct ShapeFitStep {
  std::string name;  // "rigid", "model", "sliding boundary"
  Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();
  Eigen::VectorXd displacement_m;  // (3 |V|)
  Spread surface_m;                // distances of surface nodes to the second surface
  double volume_m3 = 0;            // of the lung as it is then
  std::size_t inverted = 0;        // elements that this turns inside out, as folds of the surface may
};

struct ShapeFitResult {
  BreathingMotion motion;           // the model with what was found; phases are those of the model
  std::vector<ShapeFitStep> steps;  // three
  double first_volume_m3 = 0, second_volume_m3 = 0;
  std::optional<Spread>
      left_out_m;  // with cross_validate: distances of the second surface where it was left out
};

/// `second`: any label is lung. kiroku::Error for a mask that is empty, or has less than a fifth or more than
/// five times the lung's volume (another organ, or another unit), and what BreathingBody throws. Same input,
/// same bits.
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
