// The rays of a picture that is seen through a lens: one for each pixel, made once for a size. Immutable and
// thread-safe.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "sim/render/lens.h"

namespace kiroku::sim {

class LensRays {
 public:
  /// kiroku::UsageError as Lens::require_shape().
  LensRays(const Lens& lens, int width, int height);

  [[nodiscard]] const Lens& lens() const { return lens_; }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  /// Where a pixel looks: to the right and up, at distance 1. Rows from the top.
  [[nodiscard]] const Eigen::Vector2d& slope(int x, int y) const {
    return slopes_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                   static_cast<std::size_t>(x)];
  }

  /// Pixels [x0, x1) x [y0, y1).
  struct Pixels {
    int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  };
  /// Outside of them no pixel looks between those slopes; some within may not either.
  [[nodiscard]] Pixels pixels_within(const Eigen::Vector2d& least, const Eigen::Vector2d& greatest) const;

 private:
  struct Reach {
    Eigen::Vector2d least = Eigen::Vector2d::Constant(1e300), greatest = -least;

    void take(const Eigen::Vector2d& slope);
    [[nodiscard]] bool meets(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const;
  };
  static constexpr int kBlock = 8;

  Lens lens_;
  int width_, height_, blocks_across_;
  std::vector<Eigen::Vector2d> slopes_;  // (height x width)
  std::vector<Reach> blocks_;            // of kBlock x kBlock pixels, row by row
  std::vector<Reach> rows_;              // of blocks
};

}  // namespace kiroku::sim
