// The instruments and fingers of a planned manipulation. Pure, thread-safe.
//
// Source: surface-constraint grasping of "Interactive Volume Manipulation for Supporting Preoperative
// Planning": vertices on a constraint surface follow its motion.
#pragma once

#include <cstdint>
#include <limits>
#include <string>

#include "sim/contact/tool_shape.h"

namespace kiroku::sim {

enum class ToolAction : std::uint8_t {
  /// When told to grasp, it binds the nodes of the surface that are in its shape, and holds them, pushed or
  /// pulled, until told to release them. Its shape is a region, not a solid: while it holds nothing it passes
  /// through the tissue, and nodes that it has not bound pass through it.
  kBinds,
  /// A solid that presses and never pulls; nodes slide along it without friction.
  kGlides,
  /// A solid that presses and never pulls; a node that it presses is bound to where it lies on the solid, and
  /// let go when it would have to be pulled (ContactTool::sticks).
  kSticks,
};

struct Tool {
  std::string name;  // for errors: "forceps 1"; no two tools of a manipulation have the same
  ToolShape shape;
  ToolAction action = ToolAction::kGlides;
  /// Of one that kSticks: Coulomb's coefficient (ContactTool::friction). Infinite: what sticks never slides.
  double friction = std::numeric_limits<double>::infinity();
};

/// What closed jaws hold: the region between them, around the tool's origin.
Tool forceps(std::string name, const Vector3& half_extent_m);
/// What a pin or a suture holds: the region around its tip, the tool's origin.
Tool pin(std::string name, double radius_m);
/// A blade, around the tool's origin.
Tool flat_retractor(std::string name, const Vector3& half_extent_m, bool sticks = false);
/// The part of a hook that pulls: a rod along the tool's z axis, around its origin.
Tool hook(std::string name, double radius_m, double half_length_m, bool sticks = false);
/// A fingertip, around the tool's origin.
Tool finger(std::string name, double radius_m, bool sticks = false);

}  // namespace kiroku::sim
