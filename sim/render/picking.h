// What a pointer on a picture is on: lines from the eye, and where the surface first meets them. Pure,
// thread-safe. For cameras that are not parallel.
//
// Places are told as (to the right, up, depth), m: the view's axes with the third away from the eye. A line
// from the eye has a slope (to the right, up) for each metre of depth.
#pragma once

#include <optional>
#include <span>

#include "sim/mesh/mesh_topology.h"
#include "sim/render/camera.h"

namespace kiroku::sim {

Vector3 in_depth_m(const Camera& camera, const Vector3& patient_m);
Vector3 from_depth_m(const Camera& camera, const Vector3& place_m);

/// The line through a place of the picture, from 0 at its left upper corner to 1.
Eigen::Vector2d slope_of(const Camera& camera, double x, double y);

/// Where a place is on the picture, as slope_of() has it.
Eigen::Vector2d on_picture(const Camera& camera, const Vector3& patient_m);

/// A place on a face of a surface.
struct MetFace {
  std::size_t face = 0;               // of those that were given
  Vector3 weights = Vector3::Zero();  // of the face's corners; they sum to one
  double depth_m = 0;
};
/// Where the line first meets a face of the surface, whose nodes are at `places_m`, all before the eye.
/// Nothing where it misses all.
std::optional<MetFace> first_met(std::span<const Face> surface, std::span<const Vector3> places_m,
                                 const Eigen::Vector2d& slope);
std::optional<double> depth_along(std::span<const Face> surface, std::span<const Vector3> places_m,
                                  const Eigen::Vector2d& slope);

}  // namespace kiroku::sim
