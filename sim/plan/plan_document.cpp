#include "sim/plan/plan_document.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <set>

#include <nlohmann/json.hpp>

#include "sim/plan/written_pose.h"

namespace kiroku::sim {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t kForceps = 2, kGraspers = 2, kClips = 4, kFingers = 5;
/// A tool meets tissue at its nodes, so that none is finer than the mesh; a fingertip is no finer than a
/// person's.
constexpr double kJawsInEdges = 2, kOpeningInEdges = 6, kFingerInEdges = 1.2, kFingertipM = 0.008;

/// Of toothed jaws on moist tissue. Assumed: measured values range from 0.1 for smooth steel upwards.
constexpr double kJawFriction = 0.5;

/// Of tools: whole millimetres.
double tool_length(double length_m, LengthUnit unit) {
  constexpr double kMillimetres = 1000;
  return std::ceil(length_m * kMillimetres) / (kMillimetres / units_per_metre(unit));
}

/// "finger 2", and "finger 2 b" where the document has that name.
std::string free_name(const ordered_json& tools, std::string name) {
  while (tools.contains(name)) name += " b";
  return name;
}

double longest_side_m(const TetMesh& mesh) {
  Vector3 least = mesh.nodes.front(), greatest = least;
  for (const Vector3& node : mesh.nodes) {
    least = least.cwiseMin(node);
    greatest = greatest.cwiseMax(node);
  }
  return (greatest - least).norm();
}

ordered_json numbers(const Vector3& vector) { return {vector.x(), vector.y(), vector.z()}; }

void add_rotation(ordered_json& pose, const Eigen::Quaterniond& orientation) {
  const WrittenRotation rotation = written_rotation(orientation);
  pose["rotation"] = {{"axis", numbers(rotation.axis)}, {"degrees", rotation.degrees}};
}

ordered_json place_json(const Pose& pose, LengthUnit unit) {
  ordered_json place{{"position", numbers(written_position(pose.position_m, unit))}};
  if (!pose.orientation.vec().isZero(0)) add_rotation(place, pose.orientation);
  return place;
}

ordered_json curve_json(const CutCurve& curve, LengthUnit unit) {
  ordered_json out{{"through", ordered_json::array()}};
  for (const Vector3& handle_m : curve.handles_m)
    out["through"].push_back(numbers(written_position(handle_m, unit)));
  if (!curve.smooth) out["shape"] = "polyline";
  std::vector<double> depths;
  for (const double depth_m : curve.depth_m) depths.push_back(written_position({depth_m, 0, 0}, unit).x());
  if (depths.size() == 1) {
    out["depth"] = depths.front();
  } else {
    out["depth"] = depths;
  }
  if (curve.direction) out["direction"] = numbers(*curve.direction);
  return out;
}

ordered_json path_json(const PlanMotion& motion, LengthUnit unit, bool there_already) {
  ordered_json path = ordered_json::array();
  Eigen::Quaterniond before = Eigen::Quaterniond::Identity();
  bool first = true;
  for (const KeyFrame& frame : motion.path.frames()) {
    // A tool that is at the organ goes on from there.
    if (!(first && there_already)) {
      ordered_json one{{"at_s", frame.at_s},
                       {"position", numbers(written_position(frame.pose.position_m, unit))}};
      if (frame.pose.orientation.coeffs() != before.coeffs()) add_rotation(one, frame.pose.orientation);
      path.push_back(std::move(one));
    }
    before = frame.pose.orientation;
    first = false;
  }
  return path;
}

/// What a step does with tools that are `there` says at the organ; changes that to what it is after the step.
ordered_json step_json(const Plan& plan, const PlanStep& step, std::vector<std::uint8_t>& there) {
  const LengthUnit unit = plan.body.unit;
  const auto name = [&](std::size_t tool) { return plan.tools[tool].tool.name; };
  ordered_json out{{"do", name_of(step.action)}};
  if (!step.name.empty()) out["name"] = step.name;
  switch (step.action) {
    case PlanAction::kHold:
      out["duration_s"] = step.duration_s;
      break;
    case PlanAction::kRelease:
      out["tool"] = name(step.released.front());
      break;
    case PlanAction::kGrasp: {
      const PlanMotion& motion = step.motions.front();
      out["tool"] = name(motion.tool);
      out["at"] = place_json(motion.path.at(0), unit);
      break;
    }
    case PlanAction::kClose: {
      const PlanMotion& motion = step.motions.front();
      out["tool"] = name(motion.tool);
      if (there[motion.tool] == 0) out["at"] = place_json(motion.path.at(0), unit);
      out["opening"] = written_position({step.opening_m, 0, 0}, unit).x();
      out["duration_s"] = step.duration_s;
      break;
    }
    case PlanAction::kRetract:
    case PlanAction::kPress:
    case PlanAction::kCut:
      if (step.curve) {
        out["tool"] = name(step.motions.front().tool);
        out["curve"] = curve_json(*step.curve, unit);
      } else if (step.motions.size() == 1) {
        const PlanMotion& motion = step.motions.front();
        out["tool"] = name(motion.tool);
        out["path"] = path_json(motion, unit, there[motion.tool] != 0);
      } else {
        for (const PlanMotion& motion : step.motions)
          out["tools"][name(motion.tool)] = path_json(motion, unit, there[motion.tool] != 0);
      }
      break;
  }
  for (const PlanMotion& motion : step.motions) there[motion.tool] = step.action == PlanAction::kCut ? 0 : 1;
  for (const std::size_t tool : step.released) there[tool] = 0;
  return out;
}

}  // namespace

ordered_json with_tools(ordered_json document, const Plan& plan) {
  const LengthUnit unit = plan.body.unit;
  const double edge_m = mean_surface_edge_m(plan.body.mesh);
  const double jaws = tool_length(kJawsInEdges * edge_m, unit);
  const double thickness = tool_length(edge_m, unit);
  const double radius = tool_length(std::max(kFingerInEdges * edge_m, kFingertipM), unit);
  // So long that its heel is outside, wherever its tip is.
  const double edge = tool_length(longest_side_m(plan.body.mesh), unit);
  ordered_json& tools = document["tools"];
  const auto numbered = [](const char* name, std::size_t i) {
    return std::string(name) + " " + std::to_string(i);
  };
  for (std::size_t i = 1; i <= kForceps; ++i)
    tools[free_name(tools, numbered("forceps", i))] = {{"kind", "forceps"}, {"jaws", {jaws, jaws, jaws}}};
  for (std::size_t i = 1; i <= kGraspers; ++i) {
    tools[free_name(tools, numbered("grasper", i))] = {
        {"kind", "grasper"},
        {"jaw", {jaws, jaws, thickness}},
        {"opening", tool_length(kOpeningInEdges * edge_m, unit)},
        {"friction", kJawFriction}};
  }
  for (std::size_t i = 1; i <= kClips && !plan.corotational; ++i) {
    tools[free_name(tools, numbered("clip", i))] = {{"kind", "clip"},
                                                    {"jaw", {jaws, thickness, thickness}},
                                                    {"opening", tool_length(kOpeningInEdges * edge_m, unit)},
                                                    {"friction", kJawFriction}};
  }
  for (std::size_t i = 1; i <= kFingers; ++i)
    tools[free_name(tools, numbered("finger", i))] = {{"kind", "finger"}, {"radius", radius}};
  tools[free_name(tools, "scalpel")] = {{"kind", "scalpel"}, {"edge", edge}};
  return document;
}

ordered_json document_of(const ordered_json& own, const ordered_json& tooled, const PlanSession& session,
                         const std::string& name) {
  assert(!session.moving());
  const Plan& plan = session.plan();
  std::set<std::string> used;
  ordered_json steps = ordered_json::array();
  std::vector<std::uint8_t> there(plan.tools.size());
  for (std::size_t i = 0; i < plan.steps.size(); ++i) {
    const PlanStep& step = plan.steps[i];
    const ordered_json written = step_json(plan, step, there);
    steps.push_back(i < session.given_steps() ? own.at("steps").at(i) : written);
    for (const PlanMotion& motion : step.motions) used.insert(plan.tools[motion.tool].tool.name);
    for (const std::size_t tool : step.released) used.insert(plan.tools[tool].tool.name);
  }
  ordered_json document;
  document["name"] = name;
  for (const auto& [key, value] : own.items()) {
    if (key != "name" && key != "tools" && key != "steps") document[key] = value;
  }
  document["tools"] = ordered_json::object();
  for (const auto& [tool, value] : tooled.at("tools").items()) {
    if (used.contains(tool) || own.at("tools").contains(tool)) document["tools"][tool] = value;
  }
  document["steps"] = std::move(steps);
  return document;
}

}  // namespace kiroku::sim
