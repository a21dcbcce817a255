#include "sim/align/lens_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "sim/align/organ_surface.h"

namespace kiroku::sim {
namespace {

/// From a pixel of a picture of one side to that of another one.
double rescaled(double pixel, double side, double other) { return (pixel + 0.5) / side * other - 0.5; }

}  // namespace

void StraightPictures::make_map(int width, int height) {
  width_ = width;
  height_ = height;
  map_.clear();
  map_.reserve(2 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const Pinhole ideal = pinhole_of(lens_.field_deg(), width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector2d plane((x - ideal.middle_x) / ideal.focal_px,
                                  (y - ideal.middle_y) / ideal.focal_px);
      const Eigen::Vector2d pixel = lens_.pixel_of(plane);
      map_.push_back(static_cast<float>(rescaled(pixel.x(), lens_.calibration().width, width)));
      map_.push_back(static_cast<float>(rescaled(pixel.y(), lens_.calibration().height, height)));
    }
  }
}

Picture StraightPictures::straight(const Picture& recorded) {
  if (recorded.width != width_ || recorded.height != height_) {
    lens_.require_shape(recorded.width, recorded.height);
    make_map(recorded.width, recorded.height);
  }
  Picture made(recorded.width, recorded.height);
  const cv::Mat from(height_, width_, CV_8UC3, const_cast<std::uint8_t*>(recorded.rgb.data()));
  cv::Mat to(height_, width_, CV_8UC3, made.rgb.data());
  const cv::Mat map(height_, width_, CV_32FC2, map_.data());
  cv::remap(from, to, map, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  return made;
}

BentPictures::BentPictures(const Lens& lens, int width, int height)
    : width_(width),
      height_(height),
      half_extent_(
          half_extent_of(lens.whole_field_deg(), lens.calibration().width, lens.calibration().height)) {
  // As fine as the ideal camera in the middle; a lens that shows very much more than that is drawn coarser.
  constexpr double kMost = 2;
  const double wider =
      half_extent_.x() /
      half_extent_of(lens.field_deg(), lens.calibration().width, lens.calibration().height).x();
  const double scale = std::clamp(wider, 1.0, kMost);
  drawn_width_ = static_cast<int>(std::ceil(scale * width));
  drawn_height_ = static_cast<int>(std::ceil(scale * height));
  map_.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector2d plane = lens.plane_of(
          {rescaled(x, width, lens.calibration().width), rescaled(y, height, lens.calibration().height)});
      const Eigen::Vector2d share = plane.cwiseQuotient(half_extent_);
      map_.emplace_back(static_cast<float>((share.x() + 1) / 2 * drawn_width_ - 0.5),
                        static_cast<float>((share.y() + 1) / 2 * drawn_height_ - 0.5));
    }
  }
}

Camera BentPictures::drawn(Camera camera) const {
  camera.half_extent = half_extent_;
  camera.centre.setZero();
  return camera;
}

Picture BentPictures::bent(const Picture& drawn, const Rgb& background) const {
  Picture made(width_, height_);
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const Eigen::Vector2f& at =
          map_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x)];
      const int left = static_cast<int>(std::floor(at.x())), top = static_cast<int>(std::floor(at.y()));
      const float across = at.x() - static_cast<float>(left), down = at.y() - static_cast<float>(top);
      float is_drawn = 0;
      std::array<float, 3> sum{};
      for (int corner = 0; corner < 4; ++corner) {
        const int dx = corner % 2, dy = corner / 2;
        const std::uint8_t* const pixel =
            drawn.pixel(std::clamp(left + dx, 0, drawn.width - 1), std::clamp(top + dy, 0, drawn.height - 1));
        if (std::equal(background.begin(), background.end(), pixel)) continue;
        const float share = (dx == 1 ? across : 1 - across) * (dy == 1 ? down : 1 - down);
        is_drawn += share;
        for (std::size_t c = 0; c < 3; ++c) sum[c] += share * static_cast<float>(pixel[c]);
      }
      std::uint8_t* const into = made.pixel(x, y);
      for (std::size_t c = 0; c < 3; ++c)
        into[c] =
            is_drawn >= 0.5F ? static_cast<std::uint8_t>(std::lround(sum[c] / is_drawn)) : background[c];
    }
  }
  return made;
}

}  // namespace kiroku::sim
