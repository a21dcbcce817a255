#include "trainer/exclusion/organ_task.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "base/number_text.h"
#include "sim/haptics/latency_histogram.h"
#include "trainer/exclusion/hand_forces.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

constexpr double kHeldShare = 0.25;
constexpr double kLineOfWidth = 0.22, kLeastLineMetres = 0.03, kMostLineMetres = 0.044;
constexpr double kBelowMetres = 0.01;
/// Tissue so near to the line, across it, lies above it too.
constexpr double kAroundLineMetres = 0.015;
/// A fingertip that lifts: so far inside the border, as wide as a border is.
constexpr double kInsideBorderMetres = 0.014, kHandHalfWidthMetres = 0.068;
/// From the place that is looked at, for an organ of usual width.
constexpr double kUsualWidthMetres = 0.2, kEyeMetres = 0.46;
constexpr std::array<double, 3> kElevationsDeg{34, 48, 62};
constexpr double kRadians = std::numbers::pi / 180;
constexpr double kLookAboveLineMetres = 0.02;
constexpr double kHiddenShare = 0.02;
/// An eye nearer than that to the straight line along which the organ is lifted knows no right and left.
constexpr double kLeastAsideMetres = 0.01;

/// Where nodes are as one sees them: to the right, away, and up.
struct View {
  Vector3 aside, away, lifts;
  [[nodiscard]] Vector3 of(const Vector3& place_m) const {
    return {place_m.dot(aside), place_m.dot(away), place_m.dot(lifts)};
  }
  [[nodiscard]] Vector3 place(double right_m, double away_m, double up_m) const {
    return right_m * aside + away_m * away + up_m * lifts;
  }
};

struct Seen {
  std::vector<Vector3> nodes_m;  // those in use
  Vector3 least, greatest;
};

Seen seen_by(const View& view, const sim::TetMesh& mesh) {
  Seen seen;
  const std::vector<bool> used = sim::nodes_in_use(mesh);
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (used[node]) seen.nodes_m.push_back(view.of(mesh.nodes[node]));
  }
  seen.least = seen.greatest = seen.nodes_m.front();
  for (const Vector3& at : seen.nodes_m) {
    seen.least = seen.least.cwiseMin(at);
    seen.greatest = seen.greatest.cwiseMax(at);
  }
  return seen;
}

/// Of right and away.
struct Band {
  double right_m = 0, half_m = 0, away_from_m = 0, away_to_m = 0;
};
/// Extents of the nodes in it; nothing where there is none.
std::optional<std::pair<Vector3, Vector3>> extent_in(const Seen& seen, const Band& band) {
  std::optional<std::pair<Vector3, Vector3>> extent;
  for (const Vector3& at : seen.nodes_m) {
    if (std::abs(at.x() - band.right_m) > band.half_m || at.y() < band.away_from_m || at.y() > band.away_to_m)
      continue;
    if (!extent) extent = {at, at};
    extent->first = extent->first.cwiseMin(at);
    extent->second = extent->second.cwiseMax(at);
  }
  return extent;
}

/// The share of the line that can be seen at best with all that is not held lifted out of the way.
double best_visible_share(const sim::TetMesh& mesh, const sim::Constraints& constraints,
                          const ExclusionTask& task) {
  double best = 0;
  std::vector<double> displacement_m(3 * mesh.nodes.size());
  for (const double share : {1.0 / 3, 2.0 / 3, 1.0}) {
    for (std::size_t number = 0; number < displacement_m.size(); ++number) {
      displacement_m[number] = constraints.prescribed(number)
                                   ? 0
                                   : share * kReachMetres * task.lifts[static_cast<Eigen::Index>(number % 3)];
    }
    best = std::max(best, geometric_visible_share(mesh, displacement_m, task));
    if (best >= task.visible_share) break;
  }
  return best;
}

bool in_picture(const ExclusionTask& task, const Vector3& place_m) {
  const sim::Camera camera = camera_of(task, 4, 3);
  const Vector3 view_m = camera.view_m(place_m);
  return view_m.z() < 0 && std::abs(view_m.x() / view_m.z()) < camera.half_extent.x() &&
         std::abs(view_m.y() / view_m.z()) < camera.half_extent.y();
}

/// What makes the task impossible, as the end of a sentence about the line; empty where nothing does.
std::string impossible(const sim::TetMesh& mesh, const sim::Constraints& constraints,
                       const ExclusionTask& task) {
  if ((task.looks_at_m - task.eye_m).cross(task.lifts).norm() < kLeastAsideMetres)
    return "is looked at along the way the organ is lifted: move the eye";
  if (!in_picture(task, task.line_from_m) || !in_picture(task, task.line_to_m))
    return "is outside the picture: move it or the eye";
  const double at_rest = geometric_visible_share(mesh, {}, task);
  if (at_rest > kHiddenShare)
    return "can be seen already, " + number_text(std::round(100 * at_rest)) +
           " % of it: there is nothing to push aside";
  const double at_best = best_visible_share(mesh, constraints, task);
  if (at_best < task.visible_share)
    return "is out of reach: with all that is not held lifted by up to " +
           number_text(std::round(100 * kReachMetres)) + " cm, " + number_text(std::round(100 * at_best)) +
           " % of it could be seen";
  return "";
}

/// Eye and hand for a line.
void look_at_line(ExclusionTask& task, const View& view, const Seen& seen, double elevation_rad,
                  const OrganTaskRequest& request) {
  const Vector3 middle = (task.line_from_m + task.line_to_m) / 2;
  task.looks_at_m = middle + kLookAboveLineMetres * view.lifts;
  const double scale = std::clamp((seen.greatest.x() - seen.least.x()) / kUsualWidthMetres, 0.5, 1.5);
  task.eye_m = request.eye_m.value_or(
      task.looks_at_m +
      scale * kEyeMetres * (std::sin(elevation_rad) * view.lifts - std::cos(elevation_rad) * view.away));
  const Vector3 line = view.of(middle);
  // What a hand as wide as five fingers comes to lie under.
  const auto border = extent_in(seen, {line.x(), kHandHalfWidthMetres, seen.least.y(), line.y()});
  const double from_m = border ? border->first.y() : line.y() - kInsideBorderMetres;
  const double inside_m = std::min(from_m + kInsideBorderMetres, line.y());
  const auto above =
      extent_in(seen, {line.x(), kHandHalfWidthMetres, seen.least.y(), inside_m + kInsideBorderMetres});
  task.under_border_m =
      view.place(line.x(), inside_m, (above ? above->first.z() : line.z()) - kFingertipMetres);
}

}  // namespace

std::array<Approach, 2> usual_approaches(const sim::TetMesh& mesh) {
  const Approach from_front{Vector3::UnitZ(), Vector3::UnitY()};
  const Approach from_feet{-Vector3::UnitY(), Vector3::UnitZ()};
  const sim::Extent extent = sim::extent_of(mesh);
  const Vector3 size_m = extent.greatest - extent.least;
  if (size_m.z() <= size_m.y()) return {from_front, from_feet};
  return {from_feet, from_front};
}

std::vector<std::size_t> held_by_rule(const sim::TetMesh& mesh, const Vector3& away) {
  const std::vector<bool> used = sim::nodes_in_use(mesh);
  double least_m = std::numeric_limits<double>::infinity(), greatest_m = -least_m;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (!used[node]) continue;
    least_m = std::min(least_m, mesh.nodes[node].dot(away));
    greatest_m = std::max(greatest_m, mesh.nodes[node].dot(away));
  }
  std::vector<std::size_t> held;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (used[node] && mesh.nodes[node].dot(away) >= greatest_m - kHeldShare * (greatest_m - least_m))
      held.push_back(node);
  }
  return held;
}

OrganTask organ_task(const sim::TetMesh& mesh, const sim::Constraints& constraints, const Approach& approach,
                     const OrganTaskRequest& request) {
  const View view{approach.away.cross(approach.lifts), approach.away, approach.lifts};
  const Seen seen = seen_by(view, mesh);
  ExclusionTask task;
  task.lifts = view.lifts;
  task.aside = view.aside;
  if (request.line_m) {
    task.line_from_m = (*request.line_m)[0];
    task.line_to_m = (*request.line_m)[1];
    if ((task.line_to_m - task.line_from_m).norm() < 2 * task.line_radius_m)
      return {{}, "the line is shorter than it is thick: give its two ends"};
    look_at_line(task, view, seen, kElevationsDeg.front() * kRadians, request);
    const std::string why = impossible(mesh, constraints, task);
    if (!why.empty()) return {{}, "the line " + why};
    return {task, ""};
  }
  const Vector3 size_m = seen.greatest - seen.least;
  const double half_m = std::clamp(kLineOfWidth * size_m.x(), kLeastLineMetres, kMostLineMetres) / 2;
  std::string why = "has no place below it";
  for (const double elevation_deg : kElevationsDeg) {
    for (const auto& [depth_share, most_m] : {std::pair{1.0 / 3, 0.04}, {0.5, 0.06}, {2.0 / 3, 0.08}}) {
      for (const double right_share : {0.5, 0.4, 0.6, 0.3, 0.7}) {
        const double right_m = seen.least.x() + right_share * size_m.x();
        const auto whole = extent_in(seen, {right_m, half_m, seen.least.y(), seen.greatest.y()});
        if (!whole) continue;
        const double away_m =
            whole->first.y() + std::min(depth_share * (whole->second.y() - whole->first.y()), most_m);
        const auto above =
            extent_in(seen, {right_m, half_m, away_m - kAroundLineMetres, away_m + kAroundLineMetres});
        if (!above) continue;
        const double up_m = above->first.z() - kBelowMetres;
        task.line_from_m = view.place(right_m - half_m, away_m, up_m);
        task.line_to_m = view.place(right_m + half_m, away_m, up_m);
        look_at_line(task, view, seen, elevation_deg * kRadians, request);
        why = impossible(mesh, constraints, task);
        if (why.empty()) return {task, ""};
      }
    }
  }
  return {{}, "no line can be hidden by the rule; the last that was tried " + why};
}

double measured_force_rate_hz(const ExclusionBody& body, std::size_t fingers, Touch touch,
                              const InstrumentOptions& instruments) {
  constexpr int kSteps = 500, kRefreshEvery = 33;
  constexpr double kPeriodSeconds = 1e-3, kLiftMetres = 0.02;
  const ExclusionTask& task = body.task();
  HandForces forces(body, fingers, Feedback::kFull, touch, instruments);
  const InstrumentShape shape(instruments.tip);
  const std::vector<Trocar> trocars = trocars_of(task, fingers);
  std::vector<sim::Pose> poses(fingers, sim::Pose{Vector3::Zero(), task.lifting_hand()});
  // A whole hand grasps around the border: fingers are bent, and the palm's middle is where they are.
  const Vector3 wrist_from_fingers_m = -HandShape::kPalmMiddleMetres * task.away() -
                                       (HandShape::kPalmRadiusMetres - kFingertipMetres) * task.lifts;
  std::vector<Vector3> forces_n(fingers, Vector3::Zero());
  sim::LatencyHistogram taken;
  for (int step = 0; step < kSteps; ++step) {
    const Vector3 middle_m = task.under_border_m + kLiftMetres * step / kSteps * task.lifts;
    for (std::size_t i = 0; i < fingers; ++i) {
      poses[i].position_m = middle_m + side_by_side_m(fingers)[i] * task.aside;
      if (touch == Touch::kTrocar) poses[i] = shape.handle_for(trocars[i], poses[i].position_m);
    }
    if (touch == Touch::kHand)
      forces.wrist_at(sim::Pose{middle_m + wrist_from_fingers_m, task.lifting_hand()});
    if (step % kRefreshEvery == 0) (void)forces.refresh();
    const auto begun = std::chrono::steady_clock::now();
    forces.forces(poses, kPeriodSeconds, forces_n);
    taken.add(std::chrono::steady_clock::now() - begun);
  }
  return 1e9 / static_cast<double>(std::max<std::int64_t>(taken.percentile(0.99).count(), 1));
}

}  // namespace kiroku::trainer
