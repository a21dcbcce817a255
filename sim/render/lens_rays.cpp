#include "sim/render/lens_rays.h"

#include <algorithm>

namespace kiroku::sim {

void LensRays::Reach::take(const Eigen::Vector2d& slope) {
  least = least.cwiseMin(slope).eval();
  greatest = greatest.cwiseMax(slope).eval();
}

bool LensRays::Reach::meets(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const {
  return from.x() <= greatest.x() && to.x() >= least.x() && from.y() <= greatest.y() && to.y() >= least.y();
}

LensRays::LensRays(const Lens& lens, int width, int height)
    : lens_(lens), width_(width), height_(height), blocks_across_((width + kBlock - 1) / kBlock) {
  lens.require_shape(width, height);
  const LensCalibration& calibration = lens.calibration();
  rows_.resize(static_cast<std::size_t>((height + kBlock - 1) / kBlock));
  blocks_.resize(rows_.size() * static_cast<std::size_t>(blocks_across_));
  slopes_.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector2d pixel((x + 0.5) / width * calibration.width - 0.5,
                                  (y + 0.5) / height * calibration.height - 0.5);
      const Eigen::Vector2d plane = lens.plane_of(pixel);
      // The lens counts downwards.
      const Eigen::Vector2d slope(plane.x(), -plane.y());
      slopes_.push_back(slope);
      const auto row = static_cast<std::size_t>(y / kBlock);
      rows_[row].take(slope);
      blocks_[row * static_cast<std::size_t>(blocks_across_) + static_cast<std::size_t>(x / kBlock)].take(
          slope);
    }
  }
}

LensRays::Pixels LensRays::pixels_within(const Eigen::Vector2d& least,
                                         const Eigen::Vector2d& greatest) const {
  Pixels found{width_, height_, 0, 0};
  for (int row = 0; row < static_cast<int>(rows_.size()); ++row) {
    if (!rows_[static_cast<std::size_t>(row)].meets(least, greatest)) continue;
    for (int column = 0; column < blocks_across_; ++column) {
      if (!blocks_[static_cast<std::size_t>(row * blocks_across_ + column)].meets(least, greatest)) continue;
      found.x0 = std::min(found.x0, column * kBlock);
      found.y0 = std::min(found.y0, row * kBlock);
      found.x1 = std::max(found.x1, std::min((column + 1) * kBlock, width_));
      found.y1 = std::max(found.y1, std::min((row + 1) * kBlock, height_));
    }
  }
  return found;
}

}  // namespace kiroku::sim
