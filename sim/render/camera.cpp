#include "sim/render/camera.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "base/error.h"

namespace kiroku::sim {
namespace {

// How much of a picture's lesser side is in view, in degrees: about what an endoscope shows undistorted.
constexpr double kFieldDeg = 35;

double radians(double degrees) { return degrees * std::numbers::pi / 180; }

}  // namespace

Ball ball_around(const TetMesh& mesh) {
  const std::vector<bool> used = nodes_in_use(mesh);
  Extent extent;
  bool first = true;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (!used[node]) continue;
    extent.least = first ? mesh.nodes[node] : extent.least.cwiseMin(mesh.nodes[node]).eval();
    extent.greatest = first ? mesh.nodes[node] : extent.greatest.cwiseMax(mesh.nodes[node]).eval();
    first = false;
  }
  Ball ball{(extent.least + extent.greatest) / 2, 0};
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (used[node]) ball.radius_m = std::max(ball.radius_m, (mesh.nodes[node] - ball.centre_m).norm());
  }
  return ball;
}

ViewDirection view_direction(const std::string& text) {
  struct Named {
    const char* name;
    ViewDirection direction;
  };
  constexpr std::array<Named, 6> kNamed{{{"front", {0, 0}},
                                         {"left", {90, 0}},
                                         {"back", {180, 0}},
                                         {"right", {270, 0}},
                                         {"head", {0, 90}},
                                         {"feet", {0, -90}}}};
  for (const Named& named : kNamed) {
    if (text == named.name) return named.direction;
  }
  const std::size_t comma = text.find(',');
  try {
    if (comma != std::string::npos) {
      std::size_t azimuth_end = 0, elevation_end = 0;
      const std::string elevation = text.substr(comma + 1);
      const ViewDirection direction{std::stod(text, &azimuth_end), std::stod(elevation, &elevation_end)};
      if (azimuth_end == comma && elevation_end == elevation.size() &&
          std::abs(direction.azimuth_deg) <= 360 && std::abs(direction.elevation_deg) <= 90)
        return direction;
    }
  } catch (const std::exception&) {  // told below
  }
  throw UsageError("the view '" + text +
                   "' is none: it must be front, back, left, right, head, feet, or AZIMUTH,ELEVATION in "
                   "degrees such as 30,20 (azimuth up to 360, elevation up to 90)");
}

Camera camera_looking_at(const Ball& ball, const ViewDirection& from, int width, int height, double zoom,
                         bool parallel) {
  const double azimuth = radians(from.azimuth_deg), elevation = radians(from.elevation_deg);
  // Patient coordinates: x to the left, y to the back, z to the head.
  const Vector3 right(std::cos(azimuth), std::sin(azimuth), 0);
  const Vector3 backward(std::cos(elevation) * std::sin(azimuth), -std::cos(elevation) * std::cos(azimuth),
                         std::sin(elevation));
  Camera camera;
  camera.to_view.row(0) = right;
  camera.to_view.row(1) = backward.cross(right);
  camera.to_view.row(2) = backward;
  camera.parallel = parallel;
  const double half = radians(kFieldDeg) / 2;
  const double distance_m = ball.radius_m / std::sin(half);
  camera.eye_m = ball.centre_m + distance_m * backward;
  const double lesser = (parallel ? ball.radius_m : std::tan(half)) / zoom;
  const int side = std::min(width, height);
  camera.half_extent = {lesser * width / side, lesser * height / side};
  return camera;
}

}  // namespace kiroku::sim
