#include "sim/align/colour_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace kiroku::sim {
namespace {

/// Neighbouring cells share, so that noise does not make a colour unknown.
std::array<float, kColours> smoothed(std::array<float, kColours> cells) {
  constexpr std::array<std::pair<std::size_t, std::size_t>, 3> kAxes{
      {{kGreenCells * kLightCells, kRedCells}, {kLightCells, kGreenCells}, {1, kLightCells}}};
  for (const auto& [step, count] : kAxes) {
    std::array<float, kColours> next{};
    for (std::size_t cell = 0; cell < kColours; ++cell) {
      const std::size_t place = cell / step % count;
      const float before = cells[place > 0 ? cell - step : cell],
                  after = cells[place + 1 < count ? cell + step : cell];
      next[cell] = (before + 2 * cells[cell] + after) / 4;
    }
    cells = next;
  }
  return cells;
}

/// Where a value lies between two others, as one of so many cells; what is beyond them is of the last.
std::size_t place_of(float value, float low, float high, std::size_t count) {
  const float at = (value - low) / (high - low) * static_cast<float>(count);
  return static_cast<std::size_t>(std::clamp(at, 0.0F, static_cast<float>(count) - 0.5F));
}

std::uint16_t cell_of(const std::uint8_t* rgb) {
  // In the dark, shares are noise: below so little light they shrink to nothing.
  constexpr float kDark = 4;
  // What tissue has; the root of the light, as shade is to have cells, too.
  constexpr float kLeastRed = 0.24F, kMostRed = 0.72F, kLeastGreen = 0.08F, kMostGreen = 0.42F,
                  kMostRoot = 27.7F;
  const auto red = static_cast<float>(rgb[0]), green = static_cast<float>(rgb[1]);
  const float light = red + green + static_cast<float>(rgb[2]);
  const std::size_t reds = place_of(red / (light + kDark), kLeastRed, kMostRed, kRedCells),
                    greens = place_of(green / (light + kDark), kLeastGreen, kMostGreen, kGreenCells),
                    lights = place_of(std::sqrt(light), 0, kMostRoot, kLightCells);
  return static_cast<std::uint16_t>((reds * kGreenCells + greens) * kLightCells + lights);
}

void compare_both(ColourModel& model) {
  constexpr float kRare = 2e-5F, kMost = 3;
  for (std::size_t cell = 0; cell < kColours; ++cell) {
    const float ratio = (model.within[cell] + kRare) / (model.around[cell] + kRare);
    model.evidence[cell] = std::clamp(std::log(ratio), -kMost, kMost);
  }
}

}  // namespace

ColourCells colour_cells(const Picture& picture, const Cover& cover) {
  constexpr int kMedianPx = 5;
  const cv::Mat from(picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.rgb.data()));
  cv::Mat smooth;
  cv::medianBlur(from, smooth, kMedianPx);
  ColourCells cells;
  cells.width = picture.width;
  cells.height = picture.height;
  cells.cell.reserve(from.total());
  for (int y = 0; y < smooth.rows; ++y) {
    const auto* rgb = smooth.ptr<std::uint8_t>(y);
    for (int x = 0; x < smooth.cols; ++x, rgb += 3)
      cells.cell.push_back(cover.at(x, y) ? ColourCells::kCovered : cell_of(rgb));
  }
  return cells;
}

ColourModel colours_of(const ColourCells& cells, const Silhouette& silhouette, double ring_px) {
  constexpr float kSeamPx = 4;
  cv::Mat outside(silhouette.height, silhouette.width, CV_8U), inside(outside.size(), CV_8U);
  for (int y = 0; y < silhouette.height; ++y) {
    for (int x = 0; x < silhouette.width; ++x) {
      const bool covered = silhouette.at(x, y) > 0;
      outside.at<std::uint8_t>(y, x) = covered ? 0 : 1;
      inside.at<std::uint8_t>(y, x) = covered ? 1 : 0;
    }
  }
  cv::Mat to_organ, to_border;
  cv::distanceTransform(outside, to_organ, cv::DIST_L2, 3);
  cv::distanceTransform(inside, to_border, cv::DIST_L2, 3);
  ColourModel model;
  double within = 0, around = 0;
  const auto shrink = static_cast<float>(silhouette.shrink);
  for (int y = 0; y < silhouette.height; ++y) {
    for (int x = 0; x < silhouette.width; ++x) {
      const std::uint16_t cell = cells.at(x * silhouette.shrink, y * silhouette.shrink);
      if (cell == ColourCells::kCovered) continue;
      if (silhouette.at(x, y) > 0) {
        if (shrink * to_border.at<float>(y, x) < kSeamPx) continue;
        model.within[cell] += 1;
        within += 1;
      } else {
        const float off = shrink * to_organ.at<float>(y, x);
        if (off < kSeamPx || off > ring_px) continue;
        model.around[cell] += 1;
        around += 1;
      }
    }
  }
  if (within == 0 || around == 0) return {};
  for (float& share : model.within) share = static_cast<float>(share / within);
  for (float& share : model.around) share = static_cast<float>(share / around);
  model.within = smoothed(model.within);
  model.around = smoothed(model.around);
  compare_both(model);
  return model;
}

ColourModel mixed(const ColourModel& old, const ColourModel& newer, double share) {
  ColourModel model;
  const auto part = static_cast<float>(share);
  for (std::size_t cell = 0; cell < kColours; ++cell) {
    model.within[cell] = (1 - part) * old.within[cell] + part * newer.within[cell];
    model.around[cell] = (1 - part) * old.around[cell] + part * newer.around[cell];
  }
  compare_both(model);
  return model;
}

KindsOfColour kinds_of_colour(const Picture& picture, const Cover& cover, int shrink) {
  KindsOfColour kinds;
  kinds.width = picture.width / shrink;
  kinds.height = picture.height / shrink;
  const auto count = static_cast<std::size_t>(kinds.width) * static_cast<std::size_t>(kinds.height);
  // Means of each block: hue counts most, as light falls off towards the border.
  std::vector<Eigen::Vector3d> colours;
  std::vector<std::size_t> blocks;  // the colours are theirs
  colours.reserve(count);
  blocks.reserve(count);
  for (int y = 0; y < kinds.height; ++y) {
    for (int x = 0; x < kinds.width; ++x) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      int seen = 0;
      for (int row = 0; row < shrink; ++row) {
        for (int column = 0; column < shrink; ++column) {
          if (cover.at(x * shrink + column, y * shrink + row)) continue;
          const std::uint8_t* const rgb = picture.pixel(x * shrink + column, y * shrink + row);
          ++seen;
          sum += Eigen::Vector3d(rgb[0], rgb[1], rgb[2]);
        }
      }
      constexpr double kDark = 24, kLight = 0.4 / 255;
      if (2 * seen < shrink * shrink) continue;
      const double light = sum.sum() / seen;
      const Eigen::Vector3d mean = sum / seen;
      colours.emplace_back(2 * mean.x() / (light + kDark), 2 * mean.y() / (light + kDark),
                           kLight * light / 3);
      blocks.push_back(static_cast<std::size_t>(y * kinds.width + x));
    }
  }
  // Lloyd's iterations, begun at colours that lie far apart.
  kinds.kind.assign(count, KindsOfColour::kCovered);
  if (colours.empty()) return kinds;
  std::vector<Eigen::Vector3d> means{colours[colours.size() / 2]};
  std::vector<double> nearest(colours.size(), std::numeric_limits<double>::infinity());
  while (means.size() < KindsOfColour::kKinds) {
    std::size_t farthest = 0;
    for (std::size_t i = 0; i < colours.size(); ++i) {
      nearest[i] = std::min(nearest[i], (colours[i] - means.back()).squaredNorm());
      if (nearest[i] > nearest[farthest]) farthest = i;
    }
    means.push_back(colours[farthest]);
  }
  constexpr int kRounds = 12;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<Eigen::Vector3d> sums(means.size(), Eigen::Vector3d::Zero());
    std::vector<double> members(means.size(), 0);
    for (std::size_t i = 0; i < colours.size(); ++i) {
      std::size_t best = 0;
      for (std::size_t k = 1; k < means.size(); ++k) {
        if ((colours[i] - means[k]).squaredNorm() < (colours[i] - means[best]).squaredNorm()) best = k;
      }
      kinds.kind[blocks[i]] = static_cast<std::uint8_t>(best);
      sums[best] += colours[i];
      members[best] += 1;
    }
    for (std::size_t k = 0; k < means.size(); ++k) {
      if (members[k] > 0) means[k] = sums[k] / members[k];
    }
  }
  return kinds;
}

}  // namespace kiroku::sim
