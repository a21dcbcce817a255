// A grasper: two jaws that close on the tissue, hold it by friction alone, and lose it when it is pulled too
// hard. Pure, thread-safe.
//
// Source: section 2.2 of "Interactive Volume Manipulation for Supporting Preoperative Planning": vertices are
// displaced onto the manipulator's constraint surface, here the faces of two solid jaws, and follow these.
// Coulomb's friction says how long: two jaws that press with N each hold at most 2 mu N along their faces
// (contact/contact_solver.h).
//
// The tool's frame: jaws are as long as their x, as wide as their y, as thick as their z; they close along z,
// and the origin is midway between their faces.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "sim/contact/contact_solver.h"
#include "sim/manipulation/bound_nodes.h"
#include "sim/manipulation/tool.h"

namespace kiroku::sim {

/// Which of the two: on the side of the tool's positive z, and the other.
inline constexpr std::size_t kJaws = 2;

/// "grasper jaw 1", "grasper jaw 2".
std::string jaw_name(const std::string& tool, std::size_t which);

/// One jaw, a solid to which tissue sticks up to that friction; kiroku::UsageError as check_tools() has it
/// for one without extent. Both of a tool are alike, but for their names.
Tool jaw(const std::string& tool, std::size_t which, const Vector3& half_extent_m, double friction);

/// Where the jaws are while their faces are `opening_m` apart.
std::array<Pose, kJaws> jaw_poses(const Pose& tool, const Vector3& half_extent_m, double opening_m);

/// Whether a jaw presses tissue there with its face, which looks along `to_other`, from this jaw to the other
/// (of any length but none). What lies at its back or sides is not between the jaws.
bool presses_with_face(const Contact& contact, const Vector3& to_other);

/// Whether tissue is pressed there by the face of one of the jaws, tools `first` and `first` + 1, which are
/// at these poses.
bool between_jaws(const Contact& contact, std::uint32_t first, const std::array<Pose, kJaws>& poses);

/// What jaws do to the tissue between them, N; all zero where they touch nothing.
struct Grip {
  std::array<ToolForce, kJaws> jaws;  // what each feels, about its own origin; also at its back and sides
  double squeeze_n = 0;               // the mean of the forces with which the jaws' faces press
  double pull_n = 0;                  // what acts along their faces, both together
  double most_pull_n = 0;             // friction holds no more: 2 mu N
};

/// Whether the tissue slides along the jaws: the pull is what friction can hold, to a hundredth, as contacts
/// balance to a thousandth (contact_solver.h).
bool slips(const Grip& grip);

/// Of the contacts, those of tools `first` and `first` + 1 are the jaws', which are at these poses.
Grip grip_of(std::array<ToolForce, kJaws> felt, std::span<const Contact> contacts, std::uint32_t first,
             const std::array<Pose, kJaws>& poses, double friction);

/// The same of a clip that was left, of which `held` is what it holds (Manipulation::leave()), now at these
/// places. Forces on it balance, so that what acts along one jaw is taken back at the other: pull_n is the
/// sum of both, and slips() is true where either jaw's force leaves the cone of friction. A force that is in
/// the cone may still be the sum of some that are not: what is told to slip does; what is not may slide in
/// parts.
Grip grip_of_left(std::span<const BoundNode> held, std::span<const Vector3> places_m, const Pose& clip,
                  const std::array<Pose, kJaws>& jaws, double friction);

/// What the whole tool feels: the sum of both jaws, with the torque about the tool's origin; normal_n and
/// tangential_n are squeeze and pull.
ToolForce felt_by(const Grip& grip, const Pose& tool, const std::array<Pose, kJaws>& jaws);

}  // namespace kiroku::sim
