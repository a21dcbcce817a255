// What a manipulation refuses, in words; shared by those of linear and of turning bodies. Pure, thread-safe.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sim/contact/pose.h"
#include "sim/manipulation/tool.h"

namespace kiroku::sim {

/// Where a tool is, in the mesh's frame; nothing where it is not there: taken away, it touches nothing.
using OptionalPose = std::optional<Pose>;

/// kiroku::UsageError for tools without extent, name or friction, and for two of one name.
void check_tools(std::span<const Tool> tools);

/// The pose with a quaternion of length 1 to the last digit. kiroku::Error for one that is none.
Pose sound_pose(const Pose& pose, const std::string& tool);
/// The same of all tools, which hold so many nodes. kiroku::UsageError for another number of poses,
/// kiroku::Error for a tool that holds something and has none.
std::vector<OptionalPose> sound_poses(std::span<const Tool> tools, std::span<const OptionalPose> poses,
                                      std::span<const std::size_t> held);
/// kiroku::UsageError for a number that no tool has.
const Tool& known_tool(std::span<const Tool> tools, std::size_t tool);
/// kiroku::UsageError for a tool that does not bind, kiroku::Error for one that holds something.
void check_grasp(const Tool& tool, std::size_t held);

/// A node that jaws could meet.
struct GraspCandidate {
  std::uint32_t node = 0;
  Vector3 position_m;
  enum class State : std::uint8_t { kFree, kHeld, kFixed } state = State::kFree;
};
/// Why nothing is grasped there, in a sentence.
std::string grasp_refusal(const Tool& tool, const Pose& pose, std::span<const GraspCandidate> candidates);

/// "1 node", "12 nodes".
std::string nodes_text(std::size_t count);

}  // namespace kiroku::sim
