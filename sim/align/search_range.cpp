#include "sim/align/search_range.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

namespace kiroku::sim {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

/// Directions spread evenly over a cap of the sphere about z, by the golden angle.
std::vector<Vector3> directions_within(double spread_deg) {
  constexpr int kWholeSphere = 260;
  const double lowest = std::cos(spread_deg * kRadians), turn = std::numbers::pi * (3 - std::sqrt(5.0));
  const int count = std::max(1, static_cast<int>(std::lround(kWholeSphere * (1 - lowest) / 2)));
  std::vector<Vector3> all;
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (i + 0.5) / count * (1 - lowest), across = std::sqrt(std::max(0.0, 1 - z * z));
    all.emplace_back(across * std::cos(turn * i), across * std::sin(turn * i), z);
  }
  return all;
}

/// Rows of a view that looks along -`towards`, turned about that by `roll`.
Eigen::Matrix3d view_from(const Vector3& towards, double roll) {
  const Vector3 up = std::abs(towards.z()) < 0.9 ? Vector3::UnitZ() : Vector3::UnitY();
  const Vector3 right = up.cross(towards).normalized();
  Eigen::Matrix3d to_view;
  to_view.row(0) = right;
  to_view.row(1) = towards.cross(right);
  to_view.row(2) = towards;
  return Eigen::AngleAxisd(roll, Vector3::UnitZ()).toRotationMatrix() * to_view;
}

}  // namespace

std::vector<Eigen::Matrix3d> views_within(const SearchRange& range) {
  const Eigen::Matrix3d about =
      Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), range.from.normalized()).toRotationMatrix();
  constexpr int kRollDeg = 20;
  std::vector<Eigen::Matrix3d> views;
  for (const Vector3& direction : directions_within(range.spread_deg)) {
    for (int roll_deg = 0; roll_deg < 360; roll_deg += kRollDeg)
      views.push_back(view_from(about * direction, roll_deg * kRadians));
  }
  return views;
}

Camera camera_before(const OrganSurface& surface, const Eigen::Matrix3d& to_view,
                     const Vector3& middle_view_m) {
  Camera camera;
  camera.to_view = to_view;
  camera.eye_m = surface.middle_m - to_view.transpose() * middle_view_m;
  return camera;
}

void set_picture(Camera& camera, const Pinhole& pinhole, int width, int height) {
  camera.half_extent = Eigen::Vector2d(width, height) / 2 / pinhole.focal_px;
  camera.centre =
      Eigen::Vector2d((width - 1) / 2.0 - pinhole.middle_x, pinhole.middle_y - (height - 1) / 2.0) /
      pinhole.focal_px;
}

}  // namespace kiroku::sim
