// From where an organ is looked for when nothing is known of its place. Functions are pure and thread-safe.
#pragma once

#include <algorithm>
#include <vector>

#include "sim/align/organ_surface.h"

namespace kiroku::sim {

/// From where the organ may be seen, and how near.
struct SearchRange {
  Vector3 from{0, -1, 0};  // from the organ's middle towards the camera, patient coordinates
  double spread_deg = 75;  // how far the camera may be off that direction
  double nearest_m = 0.03, farthest_m = 0.4;  // of the organ's middle
};

/// Axes of views (Camera::to_view) from directions spread evenly over the range, each turned about its axis
/// in steps of 20 degrees: some hundred directions in half a sphere.
std::vector<Eigen::Matrix3d> views_within(const SearchRange& range);

/// The camera with these axes that has the organ's middle at a place of its view.
Camera camera_before(const OrganSurface& surface, const Eigen::Matrix3d& to_view,
                     const Vector3& middle_view_m);

/// Where a picture of so many pixels begins and ends before that camera: half_extent and centre.
void set_picture(Camera& camera, const Pinhole& pinhole, int width, int height);

/// The best of `found`, which come best first and each have a `camera`: of those that come to the same place,
/// by that share of the organ's radius, the first; so many at most.
template <typename Found>
std::vector<Found> different_places(const OrganSurface& surface, const std::vector<Found>& found, double same,
                                    std::size_t most) {
  std::vector<Found> kept;
  for (const Found& one : found) {
    const bool known = std::ranges::any_of(kept, [&](const Found& other) {
      return way_between_m(surface, other.camera, one.camera) < same * surface.radius_m;
    });
    if (!known && kept.size() < most) kept.push_back(one);
  }
  return kept;
}

}  // namespace kiroku::sim
