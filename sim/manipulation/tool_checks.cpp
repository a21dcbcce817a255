#include "sim/manipulation/tool_checks.h"

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::sim {

std::string nodes_text(std::size_t count) {
  return std::to_string(count) + (count == 1 ? " node" : " nodes");
}

void check_tools(std::span<const Tool> tools) {
  for (std::size_t i = 0; i < tools.size(); ++i) {
    const std::string& name = tools[i].name;
    if (name.empty()) throw UsageError("tool " + std::to_string(i) + " has no name");
    if (std::ranges::count(tools, name, &Tool::name) > 1) throw UsageError("two tools are called " + name);
    if (const std::string problem = problem_of(tools[i].shape); !problem.empty())
      throw UsageError("nothing can be done with " + name + ": " + problem);
    if (!(tools[i].friction > 0)) throw UsageError("the friction of " + name + " must be greater than zero");
  }
}

Pose sound_pose(const Pose& pose, const std::string& tool) {
  if (!pose.sound()) {
    throw Error("the pose of " + tool +
                " is none: its numbers must be finite and its quaternion of length 1");
  }
  return {pose.position_m, pose.orientation.normalized()};
}

std::vector<OptionalPose> sound_poses(std::span<const Tool> tools, std::span<const OptionalPose> poses,
                                      std::span<const std::size_t> held) {
  if (poses.size() != tools.size()) {
    throw UsageError(std::to_string(tools.size()) + " tools need as many poses, absent ones too; there are " +
                     std::to_string(poses.size()));
  }
  std::vector<OptionalPose> sound(poses.size());
  for (std::size_t tool = 0; tool < poses.size(); ++tool) {
    if (poses[tool]) {
      sound[tool] = sound_pose(*poses[tool], tools[tool].name);
    } else if (held[tool] > 0) {
      throw Error(tools[tool].name + " holds " + nodes_text(held[tool]) +
                  " and has no pose: say where it is, or release it first");
    }
  }
  return sound;
}

const Tool& known_tool(std::span<const Tool> tools, std::size_t tool) {
  if (tool >= tools.size()) {
    throw UsageError("there is no tool " + std::to_string(tool) + ": there are " +
                     std::to_string(tools.size()) + ", counted from 0");
  }
  return tools[tool];
}

void check_grasp(const Tool& tool, std::size_t held) {
  if (tool.action != ToolAction::kBinds)
    throw UsageError(tool.name + " presses and cannot grasp: only tools that bind can");
  if (held > 0) {
    throw Error(tool.name + " already holds " + nodes_text(held) + ": release it before it grasps again");
  }
}

std::string grasp_refusal(const Tool& tool, const Pose& pose, std::span<const GraspCandidate> candidates) {
  std::size_t held = 0, fixed = 0;
  const GraspCandidate* nearest = nullptr;
  double nearest_m = std::numeric_limits<double>::infinity();
  for (const GraspCandidate& candidate : candidates) {
    const double distance_m = distance_to(tool.shape, pose.to_tool(candidate.position_m)).distance_m;
    if (candidate.state == GraspCandidate::State::kHeld) {
      held += distance_m <= 0 ? 1 : 0;
    } else if (candidate.state == GraspCandidate::State::kFixed) {
      fixed += distance_m <= 0 ? 1 : 0;
    } else if (distance_m < nearest_m) {
      nearest_m = distance_m;
      nearest = &candidate;
    }
  }
  std::string sentence = tool.name + " finds nothing to grasp";
  if (held > 0) sentence += "; " + nodes_text(held) + " there are held by other tools";
  if (fixed > 0) sentence += "; " + nodes_text(fixed) + " there cannot move";
  if (nearest == nullptr) return sentence + "; other tools hold the whole surface: release one of them";
  return sentence + "; the nearest node of the surface that it could hold is " +
         std::to_string(nearest->node) + ", " + number_text(1e3 * nearest_m, 3) +
         " mm away: move it there or make it larger";
}

}  // namespace kiroku::sim
