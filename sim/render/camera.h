// Where pictures are taken from. Plain data; functions are pure and thread-safe.
#pragma once

#include <string>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// The view's axes are x to the right of the picture, y up, z towards who looks. A pixel at (s, t), from -1
/// at the left and lower border to 1 at the right and upper, looks along
///   (centre + (s, t) * half_extent, -1)          from the eye, or
///   (0, 0, -1) from (centre + (s, t) * half_extent, 0) where `parallel`.
struct Camera {
  Vector3 eye_m = Vector3::Zero();
  Eigen::Matrix3d to_view = Eigen::Matrix3d::Identity();  // rows: the view's axes in patient coordinates
  Eigen::Vector2d half_extent = Eigen::Vector2d::Ones();  // at distance 1; m where parallel
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();       // likewise
  bool parallel = false;

  [[nodiscard]] Vector3 view_m(const Vector3& patient_m) const { return to_view * (patient_m - eye_m); }
};

/// A ball that the picture is to show whole.
struct Ball {
  Vector3 centre_m = Vector3::Zero();
  double radius_m = 0;
};
/// Around the nodes that belong to a tetrahedron: about the middle of their extent.
Ball ball_around(const TetMesh& mesh);

/// From which side, in degrees: azimuth 0 looks from the front of the patient, 90 from the patient's left,
/// 180 from behind; elevation 90 from the head. The head is up; seen from the head the back is, from the feet
/// the front.
struct ViewDirection {
  double azimuth_deg = 0, elevation_deg = 0;
};
/// "front", "back", "left", "right", "head", "feet", or "AZIMUTH,ELEVATION". kiroku::UsageError for others.
ViewDirection view_direction(const std::string& text);

/// Looks at the ball's centre so that it fits into a picture of that size; `zoom` 2 makes it twice as large.
Camera camera_looking_at(const Ball& ball, const ViewDirection& from, int width, int height, double zoom = 1,
                         bool parallel = false);

}  // namespace kiroku::sim
