// What of a picture the organ covers as a camera sees it, and its outline with the places on the surface that
// make it. Functions are pure and thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "sim/align/organ_surface.h"

namespace kiroku::sim {

/// Depth of the organ's nearest surface for each pixel of a smaller picture, 0 where it is not.
struct Silhouette {
  int width = 0, height = 0;
  int shrink = 1;              // a pixel of it is so many of the picture wide and high
  std::vector<float> depth_m;  // (height x width), rows from the top
  [[nodiscard]] float at(int x, int y) const {
    return depth_m[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                   static_cast<std::size_t>(x)];
  }
};

/// A place of the outline.
struct OutlinePoint {
  Vector3 view_m;                        // on the surface, in the view's axes
  Eigen::Vector2d pixel;                 // on the border of the silhouette, in the picture
  Eigen::Vector2d outward;               // of length 1, pixels
  std::array<std::uint32_t, 2> nodes{};  // of the surface's edge on which it lies
  double along = 0;                      // from the first, 0, to the second, 1, on the surface
};

/// Nothing where a part of the organ is beside or behind the eye. `width` and `height` of the picture.
std::optional<Silhouette> silhouette_of(const OrganSurface& surface, const Camera& camera,
                                        const Pinhole& pinhole, int width, int height, int shrink);

/// One about each `spacing_px`, those within the picture by `margin_px`; also how much of the whole outline
/// that is.
struct Outline {
  std::vector<OutlinePoint> points;
  double share_in_picture = 0;
};
Outline outline_of(const OrganSurface& surface, const Camera& camera, const Pinhole& pinhole,
                   const Silhouette& silhouette, double spacing_px, double margin_px);

}  // namespace kiroku::sim
