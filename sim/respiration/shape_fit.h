// Fitting a breathing lung to a second shape of the same lung: a mask from another CT.
//
// Three steps, each from the one before, so that what each of them adds can be told:
//  1. the rigid motion between the two patient positions, by all of the surface but the diaphragm;
//  2. the source's model: amplitudes of rib cage and diaphragm (and directions, if asked), with the rigid
//  motion, by
//     least squares of the distances between the surfaces (Levenberg and Marquardt);
//  3. sliding boundary: each node of the surface is prescribed along its normal alone, wherever the second
//  surface
//     is, and is free to slide along it; the lung inside follows by linear elasticity. One factor, a solve a
//     step.
//
// Sources: "Simulating Lung Tumor Motion for Dynamic Tumor-tracking Irradiation" for 2; Al-Mayah et al.,
// "Toward efficient biomechanical-based deformable image registration of lungs for image-guided
// radiotherapy", Physics in Medicine and Biology 56, 2011, for a lung that slides in its cavity.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "sim/respiration/breathing_model.h"
#include "sim/respiration/landmarks.h"
#include "sim/volume/distance_field.h"

namespace kiroku::sim {

struct ShapeFitOptions {
  bool directions = false;  // both groups may move in any direction: six numbers instead of two
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
};

/// `second`: any label is lung. kiroku::Error for a mask that is empty, or has less than a fifth or more than
/// five times the lung's volume (another organ, or another unit), and what BreathingBody throws. Same input,
/// same bits.
ShapeFitResult fit_shape(const BreathingModel& model, const LabelMap& second, const ShapeFitOptions& options,
                         const std::function<void(const std::string&)>& step = {});

/// The distance that is left at landmarks of the first CT, m; those more than kLandmarkReachM outside the
/// lung are left out and counted.
struct LandmarkErrors {
  std::vector<double> before_m;                // where the lung does not move at all
  std::vector<std::vector<double>> of_step_m;  // of each step
  std::size_t outside = 0;
};
inline constexpr double kLandmarkReachM = 0.005;
LandmarkErrors errors_at(const LandmarkPairs& landmarks, const TetMesh& mesh,
                         const std::vector<ShapeFitStep>& steps);

}  // namespace kiroku::sim
