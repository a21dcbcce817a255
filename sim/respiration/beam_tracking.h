// A beam that follows a tumour: the angles of a head on gimbals, what a delay between seeing and moving
// costs, and how much tissue fields cover that follow, gate, or cover the whole path. Pure functions,
// thread-safe.
//
// The purpose is that of "Simulating Lung Tumor Motion for Dynamic Tumor-tracking Irradiation". Gimbals as in
// Kamino et al., Int. J. Radiat. Oncol. Biol. Phys. 66(1), 2006. Prediction is linear, from past places
// alone, as in Sharp et al., Physics in Medicine and Biology 49(3), 2004.
#pragma once

#include <array>
#include <vector>

#include "sim/respiration/landmarks.h"
#include "sim/respiration/timed_path.h"

namespace kiroku::sim {

/// Places at even steps. `breaths`: the path is one breath, which follows itself for so long. kiroku::Error
/// for a path that is shorter than two steps, and for more than a million places.
struct SampledPath {
  double step_s = 0;
  std::vector<Vector3> points_m;
};
SampledPath sampled(const TimedPath& path, double rate_hz, std::optional<double> breaths_s);

/// The same path, larger or smaller about its middle, so that its two places that are furthest apart are
/// `excursion_m` from each other. kiroku::Error for a path that does not move.
SampledPath scaled_to(const SampledPath& path, double excursion_m);
/// The distance between the two places of a path that are furthest apart.
double excursion_m(const SampledPath& path);

/// Where the head stands. Patient coordinates and angles as in sim/drr/projection_geometry.h.
struct BeamHead {
  double source_axis_m = 1;
  Vector3 isocenter_m = Vector3::Zero();
  double gantry_deg = 0;
};
/// How the head turns for the beam to meet a place: aside (pan) and towards the patient's head (tilt),
/// degrees.
struct GimbalAngles {
  double pan_deg = 0, tilt_deg = 0;
};
/// kiroku::Error for a place that is not in front of the source.
GimbalAngles gimbal_angles(const BeamHead& head, const Vector3& place_m);

/// Where the tumour is predicted to be `latency_s` later, at each step, from that step's place and earlier
/// ones alone: each axis by a linear function of its last second, fitted anew at each step by least squares
/// in which what is long ago counts less. The first steps, before anything could be learnt, repeat the place
/// that is known. The latency is rounded to steps, and is one step at least.
std::vector<Vector3> predicted(const SampledPath& path, double latency_s);

/// How far a beam is from the tumour that goes where the tumour was, and where it is predicted to be.
/// Distances in space, mm, from `kLearningS` on.
struct LatencyError {
  double latency_s = 0;
  Spread delayed_mm, predicted_mm;
};
inline constexpr double kLearningS = 10;
/// kiroku::Error for a path that does not outlast kLearningS and the latency by 10 s.
LatencyError latency_error(const SampledPath& path, double latency_s);

/// Fields around a tumour that is a ball. They are planned on the first half of a path, and judged on the
/// second: a breath that was not like the planned ones is missed as it would be under treatment.
struct BeamFields {
  double tumour_m3 = 0;     // the ball
  double covering_m3 = 0;   // all places that the tumour comes to, with the margin
  double gating_m3 = 0;     // those of the gate, with the margin
  double following_m3 = 0;  // the tumour and the margin
  double duty = 0;          // the part of the second half that the gate was open
  /// The part of the tumour's voxels and the beam's time that was covered. Gate and beam act on what was seen
  /// `latency_s` before; the beam that follows goes where the tumour is predicted to be.
  double covering_covered = 0, gating_covered = 0, following_covered = 0;
};
struct BeamFieldTerms {
  double tumour_m3 = 0, margin_m = 0;
  double duty = 0.3;  // planned: the gate is where the tumour is closest together for this part of the time
  double latency_s = 0.3;
};
/// Volumes are counted in voxels of a twentieth of the field's radius, 0.25 to 1 mm. kiroku::Error for a
/// tumour that is not from 0.001 to 10,000 ml, a margin that is not from 0 to 100 mm, a duty that is no part,
/// a path over more than 300 mm, and one of fewer than ten places.
BeamFields beam_fields(const SampledPath& path, const BeamFieldTerms& terms);

}  // namespace kiroku::sim
