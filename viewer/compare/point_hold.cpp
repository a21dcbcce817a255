#include "viewer/compare/point_hold.h"

#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <utility>

#include "base/error.h"

namespace kiroku::compare {
namespace {

constexpr int kLevels = 3;
constexpr double kReturnPx = 1;
/// Of the least eigenvalue of the spatial gradients, as OpenCV scales it: flat surfaces have less.
constexpr double kLeastTexture = 1e-4;

cv::Size window() { return {21, 21}; }

cv::Mat grey_of(const media::PictureView& picture) {
  media::require_valid(picture);
  // OpenCV takes memory without const; nothing writes to it here.
  const cv::Mat given(picture.height, picture.width, picture.channels == 1 ? CV_8UC1 : CV_8UC3,
                      const_cast<std::uint8_t*>(picture.samples.data()));
  if (picture.channels == 1) return given.clone();
  cv::Mat grey;
  cv::cvtColor(given, grey, cv::COLOR_RGB2GRAY);
  return grey;
}

std::vector<cv::Mat> pyramid_of(const media::PictureView& picture) {
  std::vector<cv::Mat> pyramid;
  cv::buildOpticalFlowPyramid(grey_of(picture), pyramid, window(), kLevels);
  return pyramid;
}

}  // namespace

struct PointHold::Pictures {
  std::vector<cv::Mat> pyramid;
  cv::Size size;
};

PointHold::PointHold(const media::PictureView& picture, std::span<const Eigen::Vector2d> points)
    : pictures_(
          std::make_unique<Pictures>(Pictures{pyramid_of(picture), cv::Size(picture.width, picture.height)})),
      points_(points.begin(), points.end()) {}

PointHold::~PointHold() = default;

void PointHold::follow(const media::PictureView& picture) {
  const cv::Size size(picture.width, picture.height);
  if (size != pictures_->size) throw Error("points cannot be followed into a picture of another size");
  std::vector<cv::Mat> next = pyramid_of(picture);
  std::vector<std::size_t> held;
  std::vector<cv::Point2f> from;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (!points_[i]) continue;
    held.push_back(i);
    from.emplace_back(static_cast<float>(points_[i]->x()), static_cast<float>(points_[i]->y()));
  }
  if (!held.empty()) {
    constexpr int kMostIterations = 50;
    constexpr double kEnough = 1e-3;
    const cv::TermCriteria until(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, kMostIterations, kEnough);
    std::vector<cv::Point2f> to, back;
    std::vector<unsigned char> found, returned;
    const auto flow = [&](const std::vector<cv::Mat>& a, const std::vector<cv::Mat>& b, const auto& points,
                          auto& moved, auto& status) {
      cv::calcOpticalFlowPyrLK(a, b, points, moved, status, cv::noArray(), window(), kLevels, until, 0,
                               kLeastTexture);
    };
    flow(pictures_->pyramid, next, from, to, found);
    flow(next, pictures_->pyramid, to, back, returned);
    for (std::size_t i = 0; i < held.size(); ++i) {
      const bool inside = to[i].x >= 0 && to[i].y >= 0 && to[i].x <= static_cast<float>(size.width - 1) &&
                          to[i].y <= static_cast<float>(size.height - 1);
      const bool kept =
          found[i] != 0 && returned[i] != 0 && inside && cv::norm(back[i] - from[i]) <= kReturnPx;
      points_[held[i]] = kept ? std::optional(Eigen::Vector2d(to[i].x, to[i].y)) : std::nullopt;
    }
  }
  pictures_->pyramid = std::move(next);
}

}  // namespace kiroku::compare
