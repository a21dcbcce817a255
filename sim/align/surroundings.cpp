#include "sim/align/surroundings.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include <Eigen/Cholesky>

#include "sim/align/border.h"

namespace kiroku::sim {
namespace {

// Of the picture; every second pixel of that is taken.
constexpr int kShrink = 2, kStride = 2;

using Unknowns = Eigen::Matrix<double, 8, 1>;  // shift, its four derivatives, gain, offset

/// Small and soft, so that a motion of some pixels is nearly linear in it and noise is none.
cv::Mat soft_grey(const Picture& picture) {
  const cv::Mat given(picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.rgb.data()));
  cv::Mat grey, small, made;
  cv::cvtColor(given, grey, cv::COLOR_RGB2GRAY);
  cv::resize(grey, small, {picture.width / kShrink, picture.height / kShrink}, 0, 0, cv::INTER_AREA);
  small.convertTo(made, CV_32F);
  constexpr double kSoftPx = 2;
  cv::GaussianBlur(made, made, {}, kSoftPx);
  return made;
}

}  // namespace

struct Surroundings::Kept {
  struct Place {
    int x = 0, y = 0;  // of the small picture
    Unknowns row;      // how the grey there changes with the unknowns
    double grey = 0;
  };
  int width = 0, height = 0;
  std::vector<Place> places;
  double variance = 0;  // of the grey
};

Surroundings::~Surroundings() = default;

Surroundings::Surroundings(const Picture& picture, const Cover& cover, const Silhouette& organ)
    : kept_(std::make_unique<Kept>()) {
  const cv::Mat grey = soft_grey(picture);
  kept_->width = picture.width;
  kept_->height = picture.height;
  cv::Mat covered(organ.height, organ.width, CV_8U), away;
  for (int y = 0; y < organ.height; ++y) {
    for (int x = 0; x < organ.width; ++x) covered.at<std::uint8_t>(y, x) = organ.at(x, y) > 0 ? 255 : 0;
  }
  constexpr int kAwayPx = 24;
  const int reach = kAwayPx / organ.shrink;
  cv::dilate(covered, away, cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * reach + 1, 2 * reach + 1}));
  cv::Mat by_x, by_y;
  constexpr double kHalf = 0.5;
  cv::Sobel(grey, by_x, CV_32F, 1, 0, 1, kHalf);
  cv::Sobel(grey, by_y, CV_32F, 0, 1, 1, kHalf);
  constexpr int kSeam = 8;
  double sum = 0, square = 0;
  for (int y = kSeam; y < grey.rows - kSeam; y += kStride) {
    for (int x = kSeam; x < grey.cols - kSeam; x += kStride) {
      const int column = std::min(organ.width - 1, kShrink * x / organ.shrink),
                row = std::min(organ.height - 1, kShrink * y / organ.shrink);
      if (away.at<std::uint8_t>(row, column) != 0 || cover.at(kShrink * x, kShrink * y)) continue;
      const double u = by_x.at<float>(y, x), v = by_y.at<float>(y, x), value = grey.at<float>(y, x);
      const double s = double(x) / grey.rows - double(grey.cols) / grey.rows / 2,
                   t = double(y) / grey.rows - 0.5;
      kept_->places.push_back({x, y, {-u, -v, -u * s, -u * t, -v * s, -v * t, value / 255, 1}, value});
      sum += value;
      square += value * value;
    }
  }
  const double count = double(std::max<std::size_t>(1, kept_->places.size()));
  kept_->variance = square / count - sum / count * sum / count;
}

SurroundingsLook Surroundings::look(const Picture& picture, const Cover& cover) const {
  SurroundingsLook found;
  constexpr double kLeastShare = 0.05;  // of the picture
  if (picture.width != kept_->width || picture.height != kept_->height) return found;
  const cv::Mat grey = soft_grey(picture);
  const double all = double(grey.total()) / (kStride * kStride);
  std::vector<const Kept::Place*> places;
  std::vector<double> changes;
  for (const Kept::Place& place : kept_->places) {
    if (cover.at(kShrink * place.x, kShrink * place.y)) continue;
    places.push_back(&place);
    changes.push_back(grey.at<float>(place.y, place.x) - place.grey);
  }
  if (double(places.size()) < kLeastShare * all) return found;
  Unknowns way = Unknowns::Zero();
  Eigen::Matrix<double, 8, 8> information;
  double scale = 0, weights = 0, left = 0;
  constexpr int kRounds = 6;
  std::vector<double> sizes(places.size());
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t i = 0; i < places.size(); ++i) sizes[i] = std::abs(changes[i] - places[i]->row.dot(way));
    std::vector<double> sorted = sizes;
    std::ranges::nth_element(sorted, sorted.begin() + std::ptrdiff_t(sorted.size() / 2));
    constexpr double kNormal = 1.4826, kLeastScale = 0.2, kTukey = 4.685;
    scale = std::max(kLeastScale, kNormal * sorted[sorted.size() / 2]);
    information.setZero();
    Unknowns pull = Unknowns::Zero();
    weights = left = 0;
    for (std::size_t i = 0; i < places.size(); ++i) {
      const double weight = tukey(sizes[i], kTukey * scale);
      information += weight * places[i]->row * places[i]->row.transpose();
      pull += weight * changes[i] * places[i]->row;
      weights += weight;
      left += weight * sizes[i] * sizes[i];
    }
    information.diagonal().array() += 1e-9 * information.trace();
    way = information.ldlt().solve(pull);
    if (!way.allFinite()) return found;
  }
  // Neighbouring pixels of a soft picture say the same.
  constexpr double kShared = 16;
  const Eigen::Matrix<double, 8, 8> open =
      kShared * information.ldlt().solve(Eigen::Matrix<double, 8, 8>::Identity());
  double square = 0, variance = 0;
  for (const Kept::Place* const place : places) {
    const double s = double(place->x) / grey.rows - double(grey.cols) / grey.rows / 2,
                 t = double(place->y) / grey.rows - 0.5;
    Eigen::Matrix<double, 2, 8> by = Eigen::Matrix<double, 2, 8>::Zero();
    by.row(0) << 1, 0, s, t, 0, 0, 0, 0;
    by.row(1) << 0, 1, 0, 0, s, t, 0, 0;
    square += (by * way).squaredNorm();
    variance += (by * open * by.transpose()).trace();
  }
  const double count = double(places.size());
  found.moved_px = kShrink * std::sqrt(square / count);
  found.error_px = kShrink * scale * std::sqrt(variance / count);
  found.alike = kept_->variance > 0 ? 1 - left / std::max(1.0, weights) / kept_->variance : 0;
  // What a fit leaves out is hidden anew; where that is most of it, another place is seen. Where the noise
  // alone of a good picture would leave the motion open, nothing there tells one place from another.
  constexpr double kMostErrorPx = 0.5, kLeastAlike = 0.7, kLeastKept = 0.5, kNoise = 1;
  if (kShrink * kNoise * std::sqrt(variance / count) > kMostErrorPx) return found;
  // A plain wall is any place with no contrast left.
  constexpr double kLeastGain = 0.5, kMostGain = 2;
  const double gain = 1 + way[6] / 255;
  const bool stands = gain >= kLeastGain && gain <= kMostGain && found.error_px <= kMostErrorPx &&
                      found.moved_px <= kStillPx && found.alike >= kLeastAlike &&
                      weights >= kLeastKept * count;
  found.stillness = stands ? Stillness::kStill : Stillness::kMoved;
  return found;
}

}  // namespace kiroku::sim
