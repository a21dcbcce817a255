// Pictures that a camera takes of a flat, textured sheet: every pixel is known, wherever the camera goes.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include "sim/render/camera.h"

namespace kiroku::test {

inline constexpr int kSheetWidth = 240, kSheetHeight = 180;

/// From `eye_m`, looking at `at_m`, the picture's lesser side covers 40 degrees.
inline sim::Camera camera_from(const sim::Vector3& eye_m, const sim::Vector3& at_m) {
  sim::Camera camera;
  const sim::Vector3 backward = (eye_m - at_m).normalized();
  const sim::Vector3 right = sim::Vector3::UnitZ().cross(backward).normalized();
  camera.eye_m = eye_m;
  camera.to_view.row(0) = right;
  camera.to_view.row(1) = backward.cross(right);
  camera.to_view.row(2) = backward;
  const double half = std::tan(20 * 3.14159265358979323846 / 180);
  camera.half_extent = {half * kSheetWidth / kSheetHeight, half};
  return camera;
}

/// Spots of some millimetres, no two alike.
inline double brightness(double x_mm, double y_mm) {
  return 127 + 40 * std::sin(1.1 * x_mm + 2 * std::sin(0.37 * y_mm)) +
         40 * std::sin(0.9 * y_mm + 2 * std::sin(0.31 * x_mm)) +
         30 * std::sin(0.13 * x_mm * std::cos(0.05 * y_mm));
}

/// The sheet is the plane y = 0 of the patient's axes; grey as red, green, blue.
inline std::vector<std::uint8_t> picture_of_sheet(const sim::Camera& camera) {
  std::vector<std::uint8_t> rgb;
  for (int row = 0; row < kSheetHeight; ++row) {
    for (int column = 0; column < kSheetWidth; ++column) {
      const double s = (column + 0.5) / kSheetWidth * 2 - 1, t = 1 - (row + 0.5) / kSheetHeight * 2;
      const sim::Vector3 ray =
          camera.to_view.transpose() * sim::Vector3(camera.centre.x() + s * camera.half_extent.x(),
                                                    camera.centre.y() + t * camera.half_extent.y(), -1);
      const sim::Vector3 hit = camera.eye_m - ray * (camera.eye_m.y() / ray.y());
      const auto grey = static_cast<std::uint8_t>(std::lround(brightness(hit.x() * 1000, hit.z() * 1000)));
      rgb.insert(rgb.end(), {grey, grey, grey});
    }
  }
  return rgb;
}

}  // namespace kiroku::test
