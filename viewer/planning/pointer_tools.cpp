#include "viewer/planning/pointer_tools.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <utility>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/length_unit.h"
#include "sim/render/picking.h"
#include "viewer/planning/cut_handles.h"

namespace kiroku::viewer {
namespace {

using sim::PlanTool;
using sim::Pose;
using sim::Vector3;

/// So near counts as there.
constexpr double kThereMetres = 1e-4, kThereRadians = 1e-3;
/// A fingertip comes to the organ so far before it.
constexpr double kBeforeMetres = 5e-4;
/// What holds is taken by a pointer that is no further from it than this, in lengths of its jaws' box.
constexpr double kReach = 1.5;

/// Jaws come in so many directions across the line of sight, from which the tissue's thinnest is taken; so
/// much of their length goes in, and to so much of its thickness they close.
constexpr int kJawDirections = 16;
constexpr double kJawGoesIn = 0.75, kFirstPinch = 0.75, kFirstClip = 0.5;

/// Where jaws may come beside the place that was pointed at: deeper, and along their width.
constexpr std::array<std::pair<double, double>, 5> kWays{{{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}}};

struct Grasp {
  Pose pose;
  double thickness_m = 0;
};

/// Jaws at `pose`, moved so that what of the surface is between them is in their middle; nothing where one of
/// them has nothing before it.
std::optional<Grasp> between_jaws(Pose pose, const Vector3& half_m, const std::vector<Vector3>& surface_m) {
  double least_m = 0, most_m = 0;
  for (const Vector3& each_m : surface_m) {
    const Vector3 at_m = pose.to_tool(each_m);
    if (std::abs(at_m.x()) > half_m.x() || std::abs(at_m.y()) > half_m.y()) continue;
    least_m = std::min(least_m, at_m.z());
    most_m = std::max(most_m, at_m.z());
  }
  if (least_m == 0 || most_m == 0) return std::nullopt;
  pose.position_m += (least_m + most_m) / 2 * (pose.orientation * Vector3::UnitZ());
  return Grasp{pose, most_m - least_m};
}

double radius_m(const PlanTool& tool) { return sim::bounding_radius_m(tool.tool.shape); }

}  // namespace

PointerTools::PointerTools(sim::PlanSession& session) : session_(session) {}

void PointerTools::take(Held& held) {
  const Vector3 place_m = sim::in_depth_m(camera_, held.pose.position_m);
  held.beside = place_m.head<2>() / place_m.z() - sim::slope_of(camera_, held.at.x, held.at.y);
  held.depth_m = place_m.z() - held.at.push_m;
  held.unturned = turn_of(held).conjugate() * held.pose.orientation;
}

void PointerTools::see_from(const sim::Camera& camera) {
  camera_ = camera;
  for (Held& held : held_) take(held);
}

std::vector<Vector3> PointerTools::surface_places() const {
  const sim::TetMesh& mesh = session_.mesh();
  const Eigen::VectorXd& moved_m = session_.frame().displacement_m;
  std::vector<bool> is_there(mesh.nodes.size());
  for (const sim::Face& face : sim::faces_of(mesh).surface) {
    for (const std::uint32_t node : face.nodes) is_there[node] = true;
  }
  std::vector<Vector3> places_m;
  for (std::size_t node = 0; node < is_there.size(); ++node) {
    if (is_there[node])
      places_m.push_back(mesh.nodes[node] + moved_m.segment<3>(static_cast<Eigen::Index>(3 * node)));
  }
  return places_m;
}

std::optional<Vector3> PointerTools::on_organ(double x, double y) const {
  const auto place = SeenOrgan(session_, camera_).at(x, y);
  if (!place) return {};
  return place->there_m;
}

std::optional<std::size_t> PointerTools::holder_at(const Vector3& place_m) const {
  std::optional<std::size_t> nearest;
  double nearest_m = 0;
  const auto& poses = session_.frame().poses;
  for (std::size_t tool = 0; tool < poses.size(); ++tool) {
    const PlanTool& holder = session_.plan().tools[tool];
    if (!poses[tool] || !(sim::binds(holder.kind) || sim::closes(holder.kind))) continue;
    if (session_.frame().grips[tool].left) continue;
    if (std::ranges::find(held_, tool, &Held::tool) != held_.end()) continue;
    const double distance_m = (poses[tool]->position_m - place_m).norm();
    if (distance_m > kReach * radius_m(holder) || (nearest && distance_m >= nearest_m)) continue;
    nearest = tool;
    nearest_m = distance_m;
  }
  return nearest;
}

std::vector<std::size_t> PointerTools::free_tools(sim::ToolKind kind, const char* what) const {
  const auto& poses = session_.frame().poses;
  std::vector<std::size_t> tools;
  for (std::size_t tool = 0; tool < poses.size(); ++tool) {
    if (session_.plan().tools[tool].kind == kind && !poses[tool] && !session_.used_up(tool) &&
        std::ranges::find(held_, tool, &Held::tool) == held_.end())
      tools.push_back(tool);
  }
  if (tools.empty()) {
    if (sim::stays(kind)) throw Error(std::string("all ") + what + " of the plan are used: undo one first");
    throw Error(std::string("all ") + what + " are at the organ already: release one first");
  }
  return tools;
}

/// With the first forceps that find something there: jaws are of different sizes.
std::size_t PointerTools::grasp(const Vector3& place_m) {
  end_motion();
  Pose pose;
  pose.position_m = place_m;
  const std::vector<std::size_t> tools = free_tools(sim::ToolKind::kForceps, "forceps");
  for (auto tool = tools.begin();; ++tool) {
    try {
      session_.grasp({*tool, pose});
      return *tool;
    } catch (const Error&) {
      if (std::next(tool) == tools.end()) throw;
    }
  }
}

/// With the jaws on both sides of the tissue in front of the eye, where it is thinnest across the line of
/// sight. Jaws meet nodes of the surface, and a coarse mesh may have none of these before both jaws there:
/// then the nearest place beside it is taken.
std::size_t PointerTools::pinch(const Vector3& place_m, sim::ToolKind kind) {
  end_motion();
  const bool clips = sim::stays(kind);
  const std::size_t tool = free_tools(kind, clips ? "clips" : "graspers").front();
  const PlanTool& grasper = session_.plan().tools[tool];
  const Vector3& half_m = grasper.jaw_half_extent_m();
  const std::string named = "'" + grasper.tool.name + "'";
  const Vector3 in = (place_m - camera_.eye_m).normalized();
  const Vector3 aside = camera_.to_view.row(0).transpose().cross(in).normalized();
  const std::vector<Vector3> surface_m = surface_places();
  std::optional<Grasp> best;
  for (const double shift : {0.0, 0.5, 1.0}) {
    for (int direction = 0; direction < kJawDirections; ++direction) {
      Eigen::Matrix3d axes;
      axes.col(0) = in;
      axes.col(2) = Eigen::AngleAxisd(std::numbers::pi * direction / kJawDirections, in) * aside;
      axes.col(1) = axes.col(2).cross(axes.col(0));
      for (const auto& [deeper, beside] : kWays) {
        const Vector3 from_m = place_m + (2 * kJawGoesIn - 1 + shift * deeper) * half_m.x() * in +
                               shift * beside * half_m.y() * axes.col(1);
        const auto found = between_jaws({from_m, Eigen::Quaterniond(axes).normalized()}, half_m, surface_m);
        if (found && (!best || found->thickness_m < best->thickness_m)) best = found;
      }
    }
    if (best) break;
  }
  if (!best)
    throw Error("no nodes of the surface come before both jaws of " + named + " there: take another place");
  if (best->thickness_m >= grasper.opening_m) {
    throw Error("the tissue is " + number_text(best->thickness_m * sim::kMmPerM, 2) +
                " mm thick there, and the jaws of " + named + " open by " +
                number_text(grasper.opening_m * sim::kMmPerM, 2) +
                " mm: take an edge of the organ, or look at it from another side");
  }
  session_.close({tool, best->pose}, (clips ? kFirstClip : kFirstPinch) * best->thickness_m);
  const auto& jaws = session_.frame().grips[tool].grip.jaws;
  if (std::ranges::any_of(jaws, [](const auto& jaw) { return jaw.nodes == 0; })) {
    session_.undo();
    throw Error("one of the jaws of " + named + " met nothing there: take another place");
  }
  return tool;
}

void PointerTools::close(std::size_t jaws, double share) {
  end_motion();
  const PlanTool& tool = session_.plan().tools.at(jaws);
  if (!session_.frame().poses[jaws]) throw Error("'" + tool.tool.name + "' is not at the organ");
  const double now_m = session_.frame().grips[jaws].opening_m;
  if (share > 1 && now_m == tool.opening_m)
    throw Error("the jaws of '" + tool.tool.name + "' open no further");
  session_.close({jaws, {}}, std::min(share * now_m, tool.opening_m));
}

void PointerTools::come_down(PointerUse use, const PlanPointer& pointer) {
  const auto place_m = on_organ(pointer.x, pointer.y);
  if (!place_m) {
    ignored_.push_back(pointer.id);
    return;
  }
  Held held;
  held.id = pointer.id;
  held.use = use;
  held.at = pointer;
  if (use == PointerUse::kPress) {
    held.tool = free_tools(sim::ToolKind::kFinger, "fingers").front();
    Vector3 before_m = sim::in_depth_m(camera_, *place_m);
    const double depth_m = before_m.z() - radius_m(session_.plan().tools[held.tool]) - kBeforeMetres;
    before_m *= depth_m / before_m.z();
    held.pose.position_m = sim::from_depth_m(camera_, before_m);
    held.depth_m = depth_m;
    held.unturned = turn_of(held).conjugate() * held.pose.orientation;
    held_.push_back(held);
    return;
  }
  const auto holding = holder_at(*place_m);
  if (holding) {
    held.tool = *holding;
  } else {
    switch (use) {
      case PointerUse::kPinch:
        held.tool = pinch(*place_m, sim::ToolKind::kGrasper);
        break;
      case PointerUse::kClip:
        held.tool = pinch(*place_m, sim::ToolKind::kClip);
        break;
      default:
        held.tool = grasp(*place_m);
    }
  }
  held.pose = *session_.frame().poses[held.tool];
  take(held);
  held_.push_back(held);
}

void PointerTools::point(PointerUse use, const std::vector<PlanPointer>& pointers) {
  const auto is_down = [&](std::uint32_t id) {
    return std::ranges::find(pointers, id, &PlanPointer::id) != pointers.end();
  };
  std::erase_if(ignored_, [&](std::uint32_t id) { return !is_down(id); });
  std::vector<std::size_t> lifted;
  bool gone = false;
  std::erase_if(held_, [&](const Held& held) {
    if (is_down(held.id)) return false;
    gone = true;
    if (held.use == PointerUse::kPress) lifted.push_back(held.tool);
    return true;
  });
  if (gone) end_motion();
  for (const std::size_t tool : lifted) {
    if (session_.frame().poses[tool]) session_.release(tool);
  }
  std::optional<Error> refused;
  for (const PlanPointer& pointer : pointers) {
    if (std::ranges::count(ignored_, pointer.id) > 0) continue;
    const auto held = std::ranges::find(held_, pointer.id, &Held::id);
    if (held != held_.end()) {
      held->at = pointer;
      continue;
    }
    try {
      come_down(use, pointer);
    } catch (const Error& error) {
      ignored_.push_back(pointer.id);
      refused = error;
    }
  }
  if (refused) throw Error(*refused);
}

Vector3 PointerTools::goal_m(const Held& held) const {
  const Eigen::Vector2d slope = sim::slope_of(camera_, held.at.x, held.at.y) + held.beside;
  const double depth_m = held.depth_m + held.at.push_m;
  return sim::from_depth_m(camera_, {slope.x() * depth_m, slope.y() * depth_m, depth_m});
}

Eigen::Quaterniond PointerTools::turn_of(const Held& held) const {
  constexpr double kRadians = std::numbers::pi / 180;
  const Vector3 right = camera_.to_view.row(0), up = camera_.to_view.row(1), sight = -camera_.to_view.row(2);
  const Vector3 lean = kRadians * (held.at.lean_x_deg * up + held.at.lean_y_deg * right);
  const Vector3 about = lean.norm() > 0 ? Vector3(lean.normalized()) : up;
  return Eigen::Quaterniond(Eigen::AngleAxisd(held.at.turn_deg * kRadians, sight) *
                            Eigen::AngleAxisd(lean.norm(), about));
}

bool PointerTools::advance() {
  const double most_m = kMostSpeedMetres * session_.plan().time_step_s;
  const double most_radians = kMostTurnRadians * session_.plan().time_step_s;
  bool moves = false;
  std::vector<sim::PlacedTool> next;
  for (const Held& held : held_) {
    const Vector3 way_m = goal_m(held) - held.pose.position_m;
    const Eigen::Quaterniond turned = turn_of(held) * held.unturned;
    const double radians = held.pose.orientation.angularDistance(turned);
    moves = moves || way_m.norm() > kThereMetres || radians > kThereRadians;
    Pose pose = held.pose;
    pose.position_m += way_m * std::min(1.0, most_m / std::max(way_m.norm(), most_m));
    if (radians > kThereRadians) {
      pose.orientation = pose.orientation.slerp(std::min(1.0, most_radians / radians), turned).normalized();
    }
    next.push_back({held.tool, pose});
  }
  if (!moves) return false;
  std::ranges::sort(next, {}, &sim::PlacedTool::tool);
  std::vector<std::size_t> tools;
  std::vector<Pose> poses;
  for (const sim::PlacedTool& placed : next) {
    tools.push_back(placed.tool);
    poses.push_back(placed.pose);
  }
  try {
    if (tools != moving_ || !session_.moving()) {
      end_motion();
      std::vector<sim::PlacedTool> from;
      for (const Held& held : held_) from.push_back({held.tool, held.pose});
      session_.begin_motion(std::move(from));
      moving_ = tools;
    }
    session_.advance(poses);
  } catch (const Error&) {
    release();
    throw;
  }
  for (Held& held : held_) held.pose = *session_.frame().poses[held.tool];
  return true;
}

void PointerTools::end_motion() {
  moving_.clear();
  const std::vector<sim::PlanTool>& tools = session_.plan().tools;
  for (const std::string& name : session_.end_motion()) {
    // A pointer that is still down may yet bring its finger to the tissue.
    const auto still = [&](const Held& held) { return tools[held.tool].tool.name == name; };
    if (std::ranges::none_of(held_, still)) missed_.push_back(name);
  }
}

void PointerTools::release() {
  const std::vector<Held> held = std::exchange(held_, {});
  end_motion();
  for (const Held& one : held) {
    if (one.use == PointerUse::kPress && session_.frame().poses[one.tool]) session_.release(one.tool);
    ignored_.push_back(one.id);
  }
}

std::vector<std::string> PointerTools::take_missed() { return std::exchange(missed_, {}); }

}  // namespace kiroku::viewer
