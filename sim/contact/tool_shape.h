// What touches the tissue: rigid convex shapes. Pure functions, thread-safe.
#pragma once

#include <string>
#include <variant>

#include "sim/contact/pose.h"

namespace kiroku::sim {

/// A fingertip. Its centre is the tool's origin.
struct Sphere {
  double radius_m = 0;
};
/// A finger's phalanx, a rod, a hook's shaft: all within the radius of a line along the tool's z axis, from
/// -half_length_m to half_length_m.
struct Capsule {
  double radius_m = 0, half_length_m = 0;
};
/// A flat plate, a retractor's blade, a jaw: the tool's origin is its middle.
struct Box {
  Vector3 half_extent_m = Vector3::Zero();
};
using ToolShape = std::variant<Sphere, Capsule, Box>;

/// Why nothing can be touched with it, in a sentence; empty for a sound one. Radii and half extents are to be
/// finite and greater than zero; a capsule's length may be zero.
std::string problem_of(const ToolShape& shape);

/// How far a point is from the shape, and which way is out.
struct SurfaceDistance {
  double distance_m = 0;  // negative inside
  Vector3 normal;         // of length 1: the gradient of the distance, away from the shape
};
/// The signed distance to a convex shape is a convex function, which contact stands on. Point and normal are
/// in the tool's frame. In the very middle of a shape, where all ways out are as long, one is chosen.
SurfaceDistance distance_to(const ToolShape& shape, const Vector3& point_m);

/// Of the sphere around the tool's origin that holds the shape.
double bounding_radius_m(const ToolShape& shape);

}  // namespace kiroku::sim
