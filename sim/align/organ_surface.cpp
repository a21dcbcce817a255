#include "sim/align/organ_surface.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "base/error.h"
#include "sim/mesh/mesh_topology.h"

namespace kiroku::sim {
namespace {

Eigen::Matrix3d cross_matrix(const Vector3& of) {
  Eigen::Matrix3d matrix;
  matrix << 0, -of.z(), of.y(), of.z(), 0, -of.x(), -of.y(), of.x(), 0;
  return matrix;
}

void add_edges(OrganSurface& surface) {
  struct Side {
    std::array<std::uint32_t, 2> nodes;
    std::uint32_t face;
  };
  std::vector<Side> sides;
  sides.reserve(3 * surface.faces.size());
  for (std::uint32_t face = 0; face < surface.faces.size(); ++face) {
    const auto& nodes = surface.faces[face];
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(nodes[i], nodes[(i + 1) % 3]);
      sides.push_back({{low, high}, face});
    }
  }
  std::ranges::sort(sides, {}, [](const Side& side) { return std::pair(side.nodes, side.face); });
  for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
    if (sides[i].nodes != sides[i + 1].nodes) continue;
    surface.edges.push_back({sides[i].nodes, {sides[i].face, sides[i + 1].face}});
    ++i;
  }
}

void measure(OrganSurface& surface) {
  surface.middle_m.setZero();
  for (const Vector3& node : surface.nodes) surface.middle_m += node;
  surface.middle_m /= double(surface.nodes.size());
  surface.spread_m2.setZero();
  surface.reach_m = 0;
  for (const Vector3& node : surface.nodes) {
    const Vector3 from = node - surface.middle_m;
    surface.spread_m2 += from * from.transpose();
    surface.reach_m = std::max(surface.reach_m, from.norm());
  }
  surface.spread_m2 /= double(surface.nodes.size());
  surface.radius_m = std::sqrt(surface.spread_m2.trace());
}

}  // namespace

OrganSurface organ_surface(const TetMesh& mesh) {
  const Faces faces = faces_of(mesh);
  OrganSurface surface;
  constexpr std::uint32_t kNone = UINT32_MAX;
  std::vector<std::uint32_t> number(mesh.nodes.size(), kNone);
  for (const Face& face : faces.surface) {
    auto& nodes = surface.faces.emplace_back();
    for (std::size_t i = 0; i < 3; ++i) {
      std::uint32_t& here = number[face.nodes[i]];
      if (here == kNone) {
        here = static_cast<std::uint32_t>(surface.nodes.size());
        surface.nodes.push_back(mesh.nodes[face.nodes[i]]);
        surface.mesh_nodes.push_back(face.nodes[i]);
      }
      nodes[i] = here;
    }
  }
  if (surface.faces.empty())
    throw UsageError("the mesh has no surface, so no outline can be looked for: it holds no tetrahedron");
  add_edges(surface);
  measure(surface);
  if (!(surface.radius_m > 0) || !std::isfinite(surface.radius_m))
    throw UsageError("the mesh is a point, so no outline can be looked for");
  return surface;
}

OrganSurface organ_surface(std::vector<Vector3> nodes, std::vector<std::array<std::uint32_t, 3>> faces) {
  if (nodes.size() >= UINT32_MAX || faces.empty())
    throw UsageError("the surface has no face, so no outline can be looked for");
  OrganSurface surface;
  surface.nodes = std::move(nodes);
  surface.faces = std::move(faces);
  for (std::uint32_t node = 0; node < surface.nodes.size(); ++node) surface.mesh_nodes.push_back(node);
  for (const auto& face : surface.faces) {
    if (std::ranges::any_of(face, [&](std::uint32_t node) { return node >= surface.nodes.size(); }))
      throw UsageError("the surface has a face of a node that is not there");
  }
  add_edges(surface);
  if (2 * surface.edges.size() != 3 * surface.faces.size())
    throw UsageError("the surface is not closed: an edge of it is not of two faces");
  measure(surface);
  if (!(surface.radius_m > 0) || !std::isfinite(surface.radius_m))
    throw UsageError("the surface is a point, so no outline can be looked for");
  return surface;
}

Camera after_motion(const OrganSurface& surface, const Camera& camera, const Motion& motion) {
  const Vector3 turn = motion.tail<3>() / surface.radius_m;
  const double angle = turn.norm();
  const Eigen::Matrix3d rotation =
      angle > 0 ? Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix() : Eigen::Matrix3d::Identity();
  const Vector3 middle = camera.view_m(surface.middle_m);
  Camera moved = camera;
  // Products of thousands of small turns would cease to be one.
  moved.to_view =
      Eigen::Quaterniond(Eigen::Matrix3d(rotation * camera.to_view)).normalized().toRotationMatrix();
  moved.eye_m = surface.middle_m - moved.to_view.transpose() * (middle + motion.head<3>());
  return moved;
}

Motion motion_between(const OrganSurface& surface, const Camera& from, const Camera& to) {
  Motion motion;
  motion.head<3>() = to.view_m(surface.middle_m) - from.view_m(surface.middle_m);
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(to.to_view * from.to_view.transpose()));
  motion.tail<3>() = surface.radius_m * turn.angle() * turn.axis();
  return motion;
}

MotionCovariance squared_way(const OrganSurface& surface, const Camera& camera) {
  const Eigen::Matrix3d spread = camera.to_view * surface.spread_m2 * camera.to_view.transpose();
  MotionCovariance way = MotionCovariance::Identity();
  way.bottomRightCorner<3, 3>() =
      (spread.trace() * Eigen::Matrix3d::Identity() - spread) / (surface.radius_m * surface.radius_m);
  return way;
}

double standard_error_m(const OrganSurface& surface, const Camera& camera,
                        const MotionCovariance& covariance_m2) {
  return std::sqrt(std::max(0.0, (squared_way(surface, camera) * covariance_m2).trace()));
}

double way_between_m(const OrganSurface& surface, const Camera& a, const Camera& b) {
  double sum = 0;
  for (const Vector3& node : surface.nodes) sum += (a.view_m(node) - b.view_m(node)).squaredNorm();
  return std::sqrt(sum / double(surface.nodes.size()));
}

Eigen::Matrix<double, 2, 6> Pinhole::derivative(const Vector3& view_m, const Vector3& middle_m,
                                                double radius_m) const {
  const double depth = -view_m.z(), scale = focal_px / depth;
  Eigen::Matrix<double, 2, 3> of_place;
  of_place << scale, 0, scale * view_m.x() / depth, 0, -scale, -scale * view_m.y() / depth;
  Eigen::Matrix<double, 2, 6> all;
  all.leftCols<3>() = of_place;
  all.rightCols<3>() = -of_place * cross_matrix(view_m - middle_m) / radius_m;
  return all;
}

Pinhole pinhole_of(double field_deg, int width, int height) {
  const double focal = std::min(width, height) / 2.0 / std::tan(field_deg * std::numbers::pi / 360);
  return {focal, (width - 1) / 2.0, (height - 1) / 2.0};
}

Eigen::Vector2d half_extent_of(double field_deg, int width, int height) {
  const double focal = pinhole_of(field_deg, width, height).focal_px;
  return {width / 2.0 / focal, height / 2.0 / focal};
}

}  // namespace kiroku::sim
