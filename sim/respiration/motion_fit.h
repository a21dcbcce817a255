// Fitting a breathing lung to where its tumour is on radiographs.
//
// The tumour's centre at time t is c + sum over groups of a s(t + w) B, B the tumour's part of what the
// group's motion displaces the lung by; it is projected by the geometry of each radiograph. Amplitudes,
// phases and, from two views, the direction of the diaphragm are found by least squares of the distances on
// the detectors, brought to the tumour's depth (Levenberg and Marquardt, from a grid of phases).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "sim/drr/projection_geometry.h"
#include "sim/respiration/breathing_model.h"
#include "sim/respiration/landmarks.h"

namespace kiroku::sim {

/// The tumour's centre on one radiograph.
struct RadiographPosition {
  double time_s = 0;
  std::size_t view = 0;  // which geometry, from 0
  double column = 0, row = 0;
};
/// A line of names, then a line a radiograph: "time_s,view,column,row". `view` counts geometries from 1 and
/// may be absent where there is one. kiroku::Error with the line for numbers that are none, a view that has
/// no geometry, and fewer than `least` lines.
inline constexpr std::size_t kLeastPositions = 8;
std::vector<RadiographPosition> parse_positions(std::string_view text, const std::string& name,
                                                std::size_t views, std::size_t least = kLeastPositions);

struct MotionFitOptions {
  /// Instead of both groups' amplitudes and phases, the diaphragm's amplitude, phase and direction are
  /// sought, and the rib cage moves as the model says: one point's path does not tell more. Asks for two
  /// views.
  bool direction = false;
};

struct MotionFitResult {
  BreathingMotion motion;  // amplitudes not negative; phases of a sine from 0 to a cycle
  /// Standard errors by the residuals' spread; zero for what was not sought.
  double rib_cage_m = 0, rib_cage_s = 0, diaphragm_m = 0, diaphragm_s = 0;
  Spread residual_m;                // distance between positions, at the tumour's depth
  std::vector<double> residuals_m;  // of each position
  double before_m = 0;              // mean residual with the model's own motion
};

/// kiroku::Error for a model without a tumour, a tumour that is not in front of a source, a direction sought
/// from one view, and positions that leave an amplitude, phase or direction undetermined (both groups move
/// the tumour alike in these views), saying which.
MotionFitResult fit_motion(const BreathingModel& model, const std::vector<ProjectionGeometry>& views,
                           const std::vector<RadiographPosition>& positions, const MotionFitOptions& options);

}  // namespace kiroku::sim
