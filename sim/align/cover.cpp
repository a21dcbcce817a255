#include "sim/align/cover.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace kiroku::sim {
namespace {

constexpr int kDark = 34;  // of 255

/// Long, straight and from the picture's border: an instrument's shaft.
void keep_shafts(cv::Mat& dark) {
  cv::Mat labels, figures, middles;
  const int count = cv::connectedComponentsWithStats(dark, labels, figures, middles, 8, CV_32S);
  std::vector<std::uint8_t> kept(static_cast<std::size_t>(count), 0);
  const double least_cells = 0.002 * double(dark.total());
  for (int i = 1; i < count; ++i) {
    const cv::Rect box(figures.at<int>(i, cv::CC_STAT_LEFT), figures.at<int>(i, cv::CC_STAT_TOP),
                       figures.at<int>(i, cv::CC_STAT_WIDTH), figures.at<int>(i, cv::CC_STAT_HEIGHT));
    const double cells = figures.at<int>(i, cv::CC_STAT_AREA);
    const bool at_border =
        box.x == 0 || box.y == 0 || box.x + box.width == dark.cols || box.y + box.height == dark.rows;
    if (!at_border || cells < least_cells) continue;
    std::vector<cv::Point> places;
    cv::findNonZero(labels(box) == i, places);
    const cv::RotatedRect around = cv::minAreaRect(places);
    const double longer = std::max(around.size.width, around.size.height) + 1,
                 shorter = std::min(around.size.width, around.size.height) + 1;
    constexpr double kSlender = 2.5, kFilled = 0.7;
    if (longer >= kSlender * shorter && cells >= kFilled * longer * shorter)
      kept[static_cast<std::size_t>(i)] = 255;
  }
  for (int y = 0; y < dark.rows; ++y) {
    for (int x = 0; x < dark.cols; ++x)
      dark.at<std::uint8_t>(y, x) = kept[static_cast<std::size_t>(labels.at<int>(y, x))];
  }
}

}  // namespace

Cover cover_of(const Picture& picture) {
  Cover cover;
  cover.width = std::max(1, picture.width / Cover::kShrink);
  cover.height = std::max(1, picture.height / Cover::kShrink);
  cv::Mat foreign(cover.height, cover.width, CV_8U), dark(foreign.size(), CV_8U);
  for (int y = 0; y < cover.height; ++y) {
    const int top = Cover::kShrink * y, bottom = std::min(top + 1, picture.height - 1);
    for (int x = 0; x < cover.width; ++x) {
      const int left = Cover::kShrink * x, right = std::min(left + 1, picture.width - 1);
      const std::uint8_t* const corners[] = {picture.pixel(left, top), picture.pixel(right, top),
                                             picture.pixel(left, bottom), picture.pixel(right, bottom)};
      int red = 0, green = 0, blue = 0;
      for (const std::uint8_t* const rgb : corners) {
        red += rgb[0];
        green += rgb[1];
        blue += rgb[2];
      }
      red /= 4;
      green /= 4;
      blue /= 4;
      const int most = std::max({red, green, blue}), least = std::min({red, green, blue});
      // Of tissue, red is the most by far: the least of its three colours is under five sixths of it.
      const bool grey = 6 * (most - least) < most, other = red < most - 6;
      foreign.at<std::uint8_t>(y, x) = most >= kDark && (grey || other) ? 255 : 0;
      dark.at<std::uint8_t>(y, x) = most < kDark ? 255 : 0;
    }
  }
  keep_shafts(dark);
  // Single cells are noise.
  const cv::Mat small = cv::getStructuringElement(cv::MORPH_RECT, {3, 3}),
                seam = cv::getStructuringElement(cv::MORPH_RECT, {5, 5});
  cv::morphologyEx(foreign, foreign, cv::MORPH_OPEN, small);
  cv::bitwise_or(foreign, dark, foreign);
  cv::dilate(foreign, foreign, seam);
  cover.covered.resize(foreign.total());
  std::transform(foreign.begin<std::uint8_t>(), foreign.end<std::uint8_t>(), cover.covered.begin(),
                 [](std::uint8_t value) { return static_cast<std::uint8_t>(value != 0 ? 1 : 0); });
  return cover;
}

}  // namespace kiroku::sim
