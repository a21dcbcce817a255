// The surface of an organ as its alignment needs it, and how a camera and the organ move against each other.
// Plain data; functions are pure and thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "sim/mesh/tet_mesh.h"
#include "sim/render/camera.h"

namespace kiroku::sim {

/// Six numbers in metres: how far the organ's middle moves (right, up, towards who looks), then how it turns
/// about its middle, each angle times OrganSurface::radius_m, so that all six are of one size.
using Motion = Eigen::Matrix<double, 6, 1>;
using MotionCovariance = Eigen::Matrix<double, 6, 6>;  // m^2

struct OrganSurface {
  struct Edge {
    std::array<std::uint32_t, 2> nodes;
    std::array<std::uint32_t, 2> faces;
  };
  std::vector<Vector3> nodes;                           // (|V|), those of the surface alone, m
  std::vector<std::uint32_t> mesh_nodes;                // (|V|), the number of each in the mesh
  std::vector<std::array<std::uint32_t, 3>> faces;      // anticlockwise from outside
  std::vector<Edge> edges;                              // of exactly two faces
  Vector3 middle_m = Vector3::Zero();                   // mean of the nodes
  double radius_m = 0;                                  // root of the mean squared distance to the middle
  double reach_m = 0;                                   // largest distance to the middle
  Eigen::Matrix3d spread_m2 = Eigen::Matrix3d::Zero();  // mean of (node - middle)(node - middle)^T
};

/// kiroku::UsageError for a mesh without a surface, or one that is a point.
OrganSurface organ_surface(const TetMesh& mesh);
/// Of a closed surface without anything in it, faces anticlockwise from outside. kiroku::UsageError for one
/// without a face or of no extent, a face of a node that is not there, and an edge that is not of two faces.
OrganSurface organ_surface(std::vector<Vector3> nodes, std::vector<std::array<std::uint32_t, 3>> faces);

/// The camera that sees the organ as it is seen after it made that motion before this camera.
Camera after_motion(const OrganSurface& surface, const Camera& camera, const Motion& motion);
/// The motion that leads from a camera to another one, as far as it is small: after_motion() backwards.
Motion motion_between(const OrganSurface& surface, const Camera& from, const Camera& to);
/// Mean over the surface of the squared length by which a motion moves it: motion^T * this * motion.
MotionCovariance squared_way(const OrganSurface& surface, const Camera& camera);
/// The same for a motion of that covariance: the root is the standard error of the organ's place, m.
double standard_error_m(const OrganSurface& surface, const Camera& camera,
                        const MotionCovariance& covariance_m2);
/// Root of the mean squared distance between where two cameras see the nodes, in their own axes, m.
double way_between_m(const OrganSurface& surface, const Camera& a, const Camera& b);

/// A camera that is not parallel, as pixels have it: they count from the centre of the left upper one, x to
/// the right, y down.
struct Pinhole {
  double focal_px = 0;
  double middle_x = 0, middle_y = 0;

  /// Of a place in the view's axes, which lies before the camera (z < 0).
  [[nodiscard]] Eigen::Vector2d pixel(const Vector3& view_m) const {
    return {middle_x + focal_px * view_m.x() / -view_m.z(), middle_y - focal_px * view_m.y() / -view_m.z()};
  }
  /// The place in the view's axes at that depth.
  [[nodiscard]] Vector3 place_m(const Eigen::Vector2d& pixel, double depth_m) const {
    return {(pixel.x() - middle_x) / focal_px * depth_m, (middle_y - pixel.y()) / focal_px * depth_m,
            -depth_m};
  }
  /// How a pixel moves with the motion of the organ whose middle is at `middle_m` in the view's axes.
  [[nodiscard]] Eigen::Matrix<double, 2, 6> derivative(const Vector3& view_m, const Vector3& middle_m,
                                                       double radius_m) const;
};
/// Whose lesser side covers `field_deg` degrees, square pixels, its axis through the picture's middle.
Pinhole pinhole_of(double field_deg, int width, int height);
/// Its half extent, for a Camera.
Eigen::Vector2d half_extent_of(double field_deg, int width, int height);

}  // namespace kiroku::sim
