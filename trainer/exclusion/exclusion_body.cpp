#include "trainer/exclusion/exclusion_body.h"

#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "base/error.h"
#include "sim/mesh/mesh_topology.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

constexpr std::uint8_t kLineMark = 1;
constexpr sim::Rgb kLineColour{70, 220, 120};
/// Of a fingertip that is to lift objects A and B: as far in as their border is wide. Of C: below the middle
/// of the vein.
constexpr double kUnderBorderMetres = -0.046, kUnderVeinMetres = -0.0115;
/// Where the line lies: behind the border of A and B; of C so that the vein hides it.
constexpr double kLineBehindBorderMetres = -0.02, kLineBehindVeinMetres = 0.012;
constexpr double kHalfViewRad = 14 * std::numbers::pi / 180;
constexpr std::array<std::array<double, kMostExclusionFingers>, kMostExclusionFingers> kSideBySide{
    {{0}, {-0.03, 0.03}, {-0.04, 0, 0.04}, {-0.05, -0.02, 0.02, 0.05}, {-0.06, -0.03, 0, 0.03, 0.06}}};

/// Whether the segment from `eye` to `place` goes through the triangle (Moeller and Trumbore, 1997).
bool meets(const Vector3& eye, const Vector3& place, const Vector3& a, const Vector3& b, const Vector3& c) {
  const Vector3 along = place - eye, ab = b - a, ac = c - a;
  const Vector3 p = along.cross(ac);
  const double determinant = ab.dot(p);
  if (determinant == 0) return false;
  const Vector3 to_eye = eye - a;
  const double u = to_eye.dot(p) / determinant;
  if (u < 0 || u > 1) return false;
  const Vector3 q = to_eye.cross(ab);
  const double v = along.dot(q) / determinant;
  if (v < 0 || u + v > 1) return false;
  const double t = ac.dot(q) / determinant;
  return t > 0 && t < 1;
}

}  // namespace

Eigen::Quaterniond ExclusionTask::lifting_hand() const {
  Eigen::Matrix3d axes;
  axes << aside, away(), lifts;
  return Eigen::Quaterniond(axes).normalized();
}

std::span<const double> side_by_side_m(std::size_t fingers) {
  if (fingers < 1 || fingers > kMostExclusionFingers)
    throw UsageError("an organ is pushed aside with 1 to 5 fingers, not " + std::to_string(fingers));
  return std::span(kSideBySide[fingers - 1]).first(fingers);
}

std::vector<Trocar> trocars_of(const ExclusionTask& task, std::size_t instruments) {
  constexpr double kBeforeMetres = 0.12, kBelowMetres = 0.05, kApartMetres = 0.06;
  std::vector<Trocar> trocars;
  for (const double beside_m : side_by_side_m(instruments)) {
    const double from_middle = static_cast<double>(trocars.size()) - static_cast<double>(instruments - 1) / 2;
    Trocar trocar;
    trocar.pose.position_m = task.under_border_m - kBeforeMetres * task.away() - kBelowMetres * task.lifts +
                             from_middle * kApartMetres * task.aside;
    const Vector3 inwards =
        (task.under_border_m + beside_m * task.aside - trocar.pose.position_m).normalized();
    const Vector3 down = inwards.cross(task.aside).normalized();
    Eigen::Matrix3d axes;
    axes << down.cross(inwards), down, inwards;
    trocar.pose.orientation = Eigen::Quaterniond(axes).normalized();
    trocars.push_back(trocar);
  }
  return trocars;
}

ExclusionTask exclusion_task(ObjectKind kind) {
  ExclusionTask task;
  task.eye_m = {0, -0.4, 0.25};
  task.looks_at_m = {0, -0.02, -0.005};
  const bool is_sheet = kind != ObjectKind::kVessels;
  const double below_m = half_thickness_m(kind) + 0.01;
  const double behind_m = is_sheet ? kLineBehindBorderMetres : kLineBehindVeinMetres;
  task.line_from_m = {-0.022, behind_m, -below_m};
  task.line_to_m = {0.022, behind_m, -below_m};
  task.under_border_m = {0, is_sheet ? kUnderBorderMetres : kUnderVeinMetres,
                         -half_thickness_m(kind) - kFingertipMetres};
  return task;
}

sim::Camera camera_of(const ExclusionTask& task, int width, int height) {
  sim::Camera camera;
  camera.eye_m = task.eye_m;
  const Vector3 forward = (task.looks_at_m - task.eye_m).normalized();
  const Vector3 right = forward.cross(task.lifts).normalized();
  camera.to_view.row(0) = right;
  camera.to_view.row(1) = right.cross(forward);
  camera.to_view.row(2) = -forward;
  const double up = std::tan(kHalfViewRad);
  camera.half_extent = {up * width / height, up};
  return camera;
}

sim::Solid line_of(const ExclusionTask& task) {
  sim::Pose pose;
  pose.position_m = (task.line_from_m + task.line_to_m) / 2;
  const Vector3 along = task.line_to_m - task.line_from_m;
  pose.orientation = Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), along).normalized();
  return {sim::Capsule{task.line_radius_m, along.norm() / 2}, pose, kLineColour};
}

ExclusionBody::ExclusionBody(OrganObject object, const ExclusionTask& task)
    : object_(std::move(object)), task_(task) {
  body_ = std::make_unique<sim::ElasticBody>(object_.mesh, object_.materials, object_.constraints);
  contact_ = std::make_unique<sim::ContactBody>(*body_);
  (void)contact_->compliance().groups_of(contact_->surface());
  for (std::size_t t = 0; t < object_.mesh.tetrahedra.size(); ++t)
    volumes_m3_.push_back(sim::signed_volume_m3(object_.mesh, t));
}

VisibilityMeter::VisibilityMeter(sim::SurfaceRenderer& renderer, const ExclusionTask& task, int width,
                                 int height)
    : renderer_(renderer) {
  scene_.camera = camera_of(task, width, height);
  scene_.width = width;
  scene_.height = height;
  scene_.solids.push_back({line_of(task), kLineMark, false});
  scene_.shows_body = false;
  whole_ = static_cast<double>(renderer_.render({}, scene_).pixels_of_mark[kLineMark]);
  scene_.shows_body = true;
  if (whole_ == 0) throw Error("the hidden line is outside the picture, so that nobody could ever see it");
}

double VisibilityMeter::visible_share(std::span<const double> displacement_m) {
  return static_cast<double>(renderer_.render(displacement_m, scene_).pixels_of_mark[kLineMark]) / whole_;
}

double geometric_visible_share(const sim::TetMesh& mesh, std::span<const double> displacement_m,
                               const ExclusionTask& task) {
  std::vector<Vector3> nodes = mesh.nodes;
  for (std::size_t node = 0; node < nodes.size() && !displacement_m.empty(); ++node)
    nodes[node] += Eigen::Map<const Vector3>(displacement_m.data() + 3 * node);
  const std::vector<sim::Face> faces = sim::faces_of(mesh).surface;
  constexpr int kAlong = 120, kAcross = 9;
  const Vector3 line = task.line_to_m - task.line_from_m;
  int seen = 0;
  for (int i = 0; i < kAlong; ++i) {
    const Vector3 middle = task.line_from_m + (i + 0.5) / kAlong * line;
    const Vector3 across = line.cross(middle - task.eye_m).normalized();
    for (int j = 0; j < kAcross; ++j) {
      const Vector3 place = middle + task.line_radius_m * (2 * (j + 0.5) / kAcross - 1) * across;
      const bool hidden = std::ranges::any_of(faces, [&](const sim::Face& face) {
        return meets(task.eye_m, place, nodes[face.nodes[0]], nodes[face.nodes[1]], nodes[face.nodes[2]]);
      });
      if (!hidden) ++seen;
    }
  }
  return static_cast<double>(seen) / (kAlong * kAcross);
}

}  // namespace kiroku::trainer
