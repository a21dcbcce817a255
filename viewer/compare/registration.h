// Where the endoscope was: the camera by which the rendered organ falls onto the picture, from points that a
// person picked on both. Pure functions, thread-safe.
//
// Source: pose from points by Terzakis and Lourakis, "A Consistently Fast and Globally Optimal Solution to
// the Perspective-n-Point Problem" (ECCV 2020), of points in a plane by Collins and Bartoli, "Infinitesimal
// Plane-Based Pose Estimation" (IJCV 2014); both refined by Levenberg and Marquardt.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "sim/render/camera.h"

namespace kiroku::compare {

/// One point in both worlds. Pixels count from the centre of the left upper one, x to the right, y down.
struct PickedPoint {
  sim::Vector3 organ_m = sim::Vector3::Zero();
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

struct Registration {
  sim::Camera camera;
  double field_deg = 0;  // of the picture's lesser side
  bool field_estimated = false;
  std::vector<double> error_px;  // of each point
  double rms_px = 0;
};

inline constexpr std::size_t kLeastPoints = 4, kLeastPointsForField = 6;

/// The pinhole camera (square pixels, axis through the middle) that sees the points where they were picked,
/// in the sense of least squares. `field_deg`: what angle the picture's lesser side covers; where it is not
/// known, it is estimated between 10 and 120 degrees, from kLeastPointsForField points on.
/// kiroku::UsageError in a sentence: too few points, points in one spot or on one line, points in a plane
/// that two cameras see alike, points out of the picture, and where no camera sees all points before it.
Registration register_camera(std::span<const PickedPoint> points, int width, int height,
                             std::optional<double> field_deg);

/// Where the camera sees a point; nothing for what is not before it. Pixels as of PickedPoint.
std::optional<Eigen::Vector2d> pixel_of(const sim::Camera& camera, const sim::Vector3& point_m, int width,
                                        int height);

}  // namespace kiroku::compare
