#include "viewer/planning/planning_table.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "sim/plan/plan_document.h"
#include "sim/render/picking.h"

namespace kiroku::viewer {
namespace {

using sim::Vector3;

sim::Plan to_begin_with(sim::Plan plan, bool anew) {
  if (anew) plan.steps.clear();
  return plan;
}

sim::Scene scene_of(const sim::Plan& plan, const TableOptions& options) {
  sim::Scene scene;
  scene.width = options.width;
  scene.height = options.height;
  scene.camera = sim::camera_looking_at(sim::view_of_plan(plan), {}, options.width, options.height);
  return scene;
}

/// Places along the line, evenly and at least two, so far apart that each time step of a cut meets elements
/// that the one before has not.
std::vector<Eigen::Vector2d> evenly(const std::vector<Eigen::Vector2d>& line, double apart) {
  std::vector<Eigen::Vector2d> places{line.front()};
  double since = 0;
  for (std::size_t i = 1; i < line.size(); ++i) {
    const Eigen::Vector2d from = line[i - 1], way = line[i] - from;
    double along = apart - since;
    for (; along < way.norm(); along += apart) places.emplace_back(from + way.normalized() * along);
    since = way.norm() - (along - apart);
  }
  if (since > apart / 2 || places.size() < 2) {
    places.push_back(line.back());
  } else {
    places.back() = line.back();
  }
  return places;
}

}  // namespace

PlanningTable::PlanningTable(OpenedPlan opened, bool anew, const TableOptions& options,
                             const std::function<void(double time_s)>& progress)
    : options_(options),
      opened_(std::move(opened)),
      session_(to_begin_with(opened_.plan, anew), progress),
      pointers_(session_),
      pictures_(session_.plan(), opened_.volume, sim::find_transfer_function(options.transfer),
                options.engine, scene_of(session_.plan(), options)),
      voxel_m_(opened_.volume->spacing_m),
      edge_m_(sim::mean_surface_edge_m(session_.plan().body.mesh)),
      drawn_cuts_(edge_m_),
      remarked_(session_.plan().steps.size()) {
  look({});
}

void PlanningTable::look(const ViewDeed& view) {
  camera_ = sim::camera_looking_at(sim::view_of_plan(session_.plan()), {view.azimuth_deg, view.elevation_deg},
                                   options_.width, options_.height, view.zoom);
  camera_.centre = {-2 * view.pan_x * camera_.half_extent.x(), 2 * view.pan_y * camera_.half_extent.y()};
  pictures_.set_camera(camera_);
  pointers_.see_from(camera_);
  drawn_cuts_.look_anew();
}

void PlanningTable::cut(const CutDeed& cut) {
  const auto& tools = session_.plan().tools;
  const auto scalpel = std::ranges::find(tools, sim::ToolKind::kScalpel, &sim::PlanTool::kind);
  // An edge of the mesh, where the organ is.
  const double depth_m = sim::in_depth_m(camera_, sim::view_of_plan(session_.plan()).centre_m).z();
  std::vector<Eigen::Vector2d> slopes;
  slopes.reserve(cut.line.size());
  for (const Eigen::Vector2d& at : cut.line) slopes.push_back(sim::slope_of(camera_, at.x(), at.y()));
  std::vector<Vector3> places_m, rest_m;
  std::vector<std::ptrdiff_t> met;
  const std::vector<Eigen::Vector2d> even = evenly(slopes, edge_m_ / depth_m);
  const SeenOrgan organ(session_, camera_);
  for (const Eigen::Vector2d& slope : even) {
    const Eigen::Vector2d at = (slope - camera_.centre).cwiseQuotient(camera_.half_extent);
    const auto place = organ.at((1 + at.x()) / 2, (1 - at.y()) / 2);
    places_m.push_back(place ? place->there_m : Vector3::Zero());
    if (!place) continue;
    met.push_back(static_cast<std::ptrdiff_t>(places_m.size()) - 1);
    rest_m.push_back(place->rest_m);
  }
  if (met.empty()) throw Error("the line does not cross the organ: draw it over the organ");
  const auto tool = static_cast<std::size_t>(scalpel - tools.begin());
  if (met.size() == even.size()) {
    if (const auto curve = curve_through(rest_m, cut.depth_m, session_.plan().body.mesh))
      return session_.cut(tool, *curve);
  }
  // Over a border the organ is divided, for which the surface has no place. Beside the organ the depth is
  // that of the nearest place which is on it.
  Vector3 towards_m = Vector3::Zero();
  for (std::size_t i = 0; i < even.size(); ++i) {
    const auto nearest = *std::ranges::min_element(
        met, {}, [&](std::ptrdiff_t hit) { return std::abs(hit - static_cast<std::ptrdiff_t>(i)); });
    const double z_m = sim::in_depth_m(camera_, places_m[static_cast<std::size_t>(nearest)]).z();
    places_m[i] = sim::from_depth_m(camera_, {even[i].x() * z_m, even[i].y() * z_m, z_m});
    towards_m += (camera_.eye_m - places_m[i]).normalized();
  }
  // The edge points to who looks on; its tip is as deep as asked for.
  towards_m.normalize();
  sim::Pose pose;
  pose.orientation = Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), towards_m);
  std::vector<sim::Pose> path;
  for (const Vector3& place_m : places_m) {
    pose.position_m = place_m - cut.depth_m * towards_m;
    path.push_back(pose);
  }
  session_.cut(tool, path);
  remarks_.emplace_back(
      "the line goes over the organ's border, a fold or an open cut: it is cut straight down and has no "
      "handles; draw it on one surface alone to change it afterwards");
}

void PlanningTable::change(const HandleDeed& handle) {
  session_.change_cut(handle.step, changed_curve(session_, camera_, handle));
  remarked_ = std::min(remarked_, handle.step);
}

std::size_t PlanningTable::tool_named(const std::string& name) const {
  const auto& tools = session_.plan().tools;
  const auto tool = std::ranges::find(tools, name, [](const sim::PlanTool& one) { return one.tool.name; });
  if (tool == tools.end()) throw Error("there is no tool of that name");
  return static_cast<std::size_t>(tool - tools.begin());
}

void PlanningTable::apply(const Deed& deed) {
  if (const auto* view = std::get_if<ViewDeed>(&deed)) return look(*view);
  if (const auto* point = std::get_if<PointDeed>(&deed)) return pointers_.point(point->use, point->pointers);
  if (const auto* stress = std::get_if<StressDeed>(&deed))
    return pictures_.set_largest_pa(stress->largest_pa);
  if (const auto* close = std::get_if<CloseDeed>(&deed))
    return pointers_.close(tool_named(close->tool), close->share);
  pointers_.release();
  if (const auto* line = std::get_if<CutDeed>(&deed)) {
    cut(*line);
  } else if (const auto* handle = std::get_if<HandleDeed>(&deed)) {
    change(*handle);
  } else if (const auto* hold = std::get_if<HoldDeed>(&deed)) {
    session_.hold(std::max(hold->duration_s, session_.plan().time_step_s));
  } else if (const auto* release = std::get_if<ReleaseDeed>(&deed)) {
    session_.release(tool_named(release->tool));
  } else if (std::holds_alternative<UndoDeed>(deed)) {
    if (const auto step = session_.undo()) remarked_ = std::min(remarked_, *step);
  } else if (const auto step = session_.redo()) {
    remarked_ = std::min(remarked_, *step);
  }
}

std::vector<std::string> PlanningTable::take_remarks() {
  std::vector<std::string> remarks = std::exchange(remarks_, {});
  for (const std::string& name : pointers_.take_missed())
    remarks.push_back("'" + name + "' never touched the tissue, so that it is in no step: push deeper");
  if (session_.moving()) return remarks;
  const std::vector<sim::StepFigures>& figures = session_.figures();
  for (; remarked_ < figures.size(); ++remarked_)
    remarks.insert(remarks.end(), figures[remarked_].remarks.begin(), figures[remarked_].remarks.end());
  return remarks;
}

sim::Picture PlanningTable::picture(double share, bool moving) {
  const double spacing_m =
      voxel_m_ * (moving ? sim::Scene::kMovingVoxelShare : sim::Scene::kVoxelShare) / share;
  pictures_.set_size(static_cast<int>(std::lround(options_.width * share)),
                     static_cast<int>(std::lround(options_.height * share)), spacing_m, moving);
  return pictures_.picture(session_.frame(), session_.mesh());
}

Eigen::Vector2d PlanningTable::on_picture(const Vector3& place_m) const {
  return sim::on_picture(camera_, place_m);
}

nlohmann::ordered_json PlanningTable::document(const std::string& name) {
  pointers_.release();
  if (session_.plan().steps.empty()) throw Error("a plan has at least one step: do something first");
  return sim::document_of(opened_.own, opened_.tooled, session_, name);
}

}  // namespace kiroku::viewer
