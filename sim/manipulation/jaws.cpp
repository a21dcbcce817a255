#include "sim/manipulation/jaws.h"

namespace kiroku::sim {

std::string jaw_name(const std::string& tool, std::size_t which) {
  return tool + " jaw " + std::to_string(which + 1);
}

Tool jaw(const std::string& tool, std::size_t which, const Vector3& half_extent_m, double friction) {
  Tool made{jaw_name(tool, which), Box{half_extent_m}, ToolAction::kSticks};
  made.friction = friction;
  return made;
}

std::array<Pose, kJaws> jaw_poses(const Pose& tool, const Vector3& half_extent_m, double opening_m) {
  const double away_m = opening_m / 2 + half_extent_m.z();
  std::array<Pose, kJaws> jaws{tool, tool};
  jaws[0].position_m = tool.from_tool({0, 0, away_m});
  jaws[1].position_m = tool.from_tool({0, 0, -away_m});
  return jaws;
}

bool presses_with_face(const Contact& contact, const Vector3& to_other) {
  // A box's edges are sharp: normals are its faces', but for nodes that lie beside an edge.
  constexpr double kAlongFace = 0.5;
  return contact.normal.dot(to_other) > kAlongFace * to_other.norm();
}

bool between_jaws(const Contact& contact, std::uint32_t first, const std::array<Pose, kJaws>& poses) {
  if (contact.tool < first || contact.tool >= first + kJaws) return false;
  const std::size_t which = contact.tool - first;
  return presses_with_face(contact, poses[1 - which].position_m - poses[which].position_m);
}

Grip grip_of(std::array<ToolForce, kJaws> felt, std::span<const Contact> contacts, std::uint32_t first,
             const std::array<Pose, kJaws>& poses, double friction) {
  Grip grip{felt, 0, 0, 0};
  double normal_n = 0;
  Vector3 along_n = Vector3::Zero();
  for (const Contact& contact : contacts) {
    if (!between_jaws(contact, first, poses)) continue;
    const double pressed_n = contact.force_n.dot(contact.normal);
    normal_n += pressed_n;
    along_n += contact.force_n - pressed_n * contact.normal;
  }
  grip.squeeze_n = normal_n / kJaws;
  grip.pull_n = along_n.norm();
  grip.most_pull_n = friction * normal_n;
  return grip;
}

Grip grip_of_left(std::span<const BoundNode> held, std::span<const Vector3> places_m, const Pose& clip,
                  const std::array<Pose, kJaws>& jaws, double friction) {
  Grip grip;
  for (std::size_t i = 0; i < held.size(); ++i) {
    const std::size_t which = clip.to_tool(places_m[i]).z() > 0 ? 0 : 1;
    ToolForce& jaw = grip.jaws[which];
    jaw.force_n -= held[i].force_n;
    jaw.torque_nm -= (places_m[i] - jaws[which].position_m).cross(held[i].force_n);
    ++jaw.nodes;
  }
  const Vector3 closing = clip.orientation * Vector3::UnitZ();
  double normal_n = 0;
  for (std::size_t which = 0; which < kJaws; ++which) {
    ToolForce& jaw = grip.jaws[which];
    const Vector3 outwards = which == 0 ? closing : Vector3(-closing);
    jaw.normal_n = jaw.force_n.dot(outwards);
    jaw.tangential_n = (jaw.force_n - jaw.normal_n * outwards).norm();
    normal_n += jaw.normal_n;
    grip.pull_n += jaw.tangential_n;
  }
  grip.squeeze_n = normal_n / kJaws;
  grip.most_pull_n = friction * normal_n;
  return grip;
}

bool slips(const Grip& grip) {
  constexpr double kUsedUp = 0.99;
  return grip.squeeze_n > 0 && grip.pull_n >= kUsedUp * grip.most_pull_n;
}

ToolForce felt_by(const Grip& grip, const Pose& tool, const std::array<Pose, kJaws>& jaws) {
  ToolForce sum;
  for (std::size_t which = 0; which < kJaws; ++which) {
    const ToolForce& one = grip.jaws[which];
    sum.force_n += one.force_n;
    sum.torque_nm += one.torque_nm + (jaws[which].position_m - tool.position_m).cross(one.force_n);
    sum.nodes += one.nodes;
  }
  sum.normal_n = grip.squeeze_n;
  sum.tangential_n = grip.pull_n;
  return sum;
}

}  // namespace kiroku::sim
