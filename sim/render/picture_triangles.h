// Triangles as the pixels of a picture find them, without a graphics library. Functions are pure and
// thread-safe.
//
// Each edge is a function of the ray through a pixel, affine in its slope, and positive inside (Olano and
// Greer, "Triangle Scan Conversion using 2D Homogeneous Coordinates", Graphics Hardware 1997). It needs no
// division, so that corners may lie behind the eye. Two triangles that share an edge have the same function
// of it but for the sign, so that each pixel along it is in exactly one of them.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sim/render/scene.h"

namespace kiroku::sim {

/// Slopes of the rays through a picture's columns and rows, at distance 1; places in mm where parallel. Rows
/// from the top.
struct PixelRays {
  std::vector<double> u, v;
  bool parallel = false;
  /// Where a lens bends them: those of each pixel, instead of the above.
  std::shared_ptr<const LensRays> lens;

  [[nodiscard]] Eigen::Vector2d of(int x, int y) const {
    if (lens) return lens->slope(x, y);
    return {u[static_cast<std::size_t>(x)], v[static_cast<std::size_t>(y)]};
  }
};
PixelRays pixel_rays(const Scene& scene);

struct PictureTriangle {
  /// The edge opposite each corner: [0] u + [1] v + [2], positive inside.
  std::array<std::array<double, 3>, 3> edges;
  std::array<bool, 3> owns_edge;       // whether a pixel on it is inside
  std::array<double, 3> depth_mm;      // of the corners, along the view
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // pixels that may be covered: from the first, before the second
  std::uint32_t number = 0;            // whose it is; for the caller

  struct Hit {
    std::array<double, 3> shares;  // of the corners, 1 in all
    double depth_mm;
  };
  [[nodiscard]] std::optional<Hit> hit(double u, double v) const {
    std::array<double, 3> at{};
    double sum = 0;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const auto& edge = edges[corner];
      at[corner] = edge[0] * u + (edge[1] * v + edge[2]);
      if (at[corner] < 0 || (at[corner] == 0 && !owns_edge[corner])) return std::nullopt;
      sum += at[corner];
    }
    if (!(sum > 0)) return std::nullopt;
    Hit found{at, 0};
    for (std::size_t corner = 0; corner < 3; ++corner) {
      found.shares[corner] /= sum;
      found.depth_mm += found.shares[corner] * depth_mm[corner];
    }
    return found;
  }
};

/// Nothing for one that shows its back or covers no pixel. `corners_mm` in the view's axes, anticlockwise
/// from outside; `numbers` tell corners apart: triangles that share an edge number its ends alike.
std::optional<PictureTriangle> picture_triangle(std::span<const Vector3, 3> corners_mm,
                                                const std::array<std::uint32_t, 3>& numbers,
                                                const PixelRays& rays);

/// Which triangles each square of `tile` pixels may see; squares row by row.
class TriangleTiles {
 public:
  TriangleTiles(std::span<const PictureTriangle> triangles, int width, int height, int tile);
  [[nodiscard]] std::span<const std::uint32_t> of(std::size_t square) const {
    return std::span(numbers_).subspan(begin_[square], begin_[square + 1] - begin_[square]);
  }

 private:
  std::vector<std::size_t> begin_;
  std::vector<std::uint32_t> numbers_;
};

}  // namespace kiroku::sim
