// Pictures as a lens with barrel distortion shows them, and its calibration. By a formula of their own, not
// by the product's: what is drawn in follows the distance in the recorded picture, of which a calibration's
// polynomial is the inverse, to some hundredths of a pixel.
#pragma once

#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include <Eigen/Core>
#include <Eigen/QR>

#include "sim/align/organ_surface.h"
#include "sim/render/lens.h"
#include "sim/render/picture.h"

namespace kiroku::test {

struct BarrelLens {
  double drawn_in = 0.05;  // a corner shows what is by that share further from the middle than a pinhole's
  double scale = 1;        // pixels of the picture without distortion that are one in the middle
  int width = 640, height = 480;

  /// With corners that show what the picture without distortion has in its own.
  static BarrelLens of_corners(double drawn_in) { return {drawn_in, 1 / (1 + drawn_in)}; }

  /// What of the picture without distortion a pixel shows.
  [[nodiscard]] Eigen::Vector2d straight(const Eigen::Vector2d& pixel) const {
    const Eigen::Vector2d middle((width - 1) / 2.0, (height - 1) / 2.0), off = pixel - middle;
    return middle + scale * (1 + drawn_in * off.squaredNorm() / middle.squaredNorm()) * off;
  }
  /// Linear between pixels; beyond the picture its border goes on.
  [[nodiscard]] sim::Picture through(const sim::Picture& picture) const {
    const cv::Mat from(picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.rgb.data()));
    cv::Mat x(from.size(), CV_32F), y(from.size(), CV_32F);
    for (int row = 0; row < from.rows; ++row) {
      for (int column = 0; column < from.cols; ++column) {
        const Eigen::Vector2d at = straight({column, row});
        x.at<float>(row, column) = static_cast<float>(at.x());
        y.at<float>(row, column) = static_cast<float>(at.y());
      }
    }
    sim::Picture made(picture.width, picture.height);
    cv::Mat to(from.size(), CV_8UC3, made.rgb.data());
    cv::remap(from, to, x, y, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    return made;
  }
  /// The field of view that its picture's lesser side covers, where that of one without distortion covers
  /// `field_deg`.
  [[nodiscard]] double field_deg(double straight_deg) const {
    const sim::Pinhole pinhole = sim::pinhole_of(straight_deg, width, height);
    const Eigen::Vector2d top = straight({(width - 1) / 2.0, -0.5});
    return 2 * std::atan((pinhole.middle_y - top.y()) / pinhole.focal_px) * 180 / std::numbers::pi;
  }
  /// k1, k2 and k3 by least squares, as a calibration finds them.
  [[nodiscard]] sim::LensCalibration calibration(double straight_deg) const {
    const double focal = sim::pinhole_of(straight_deg, width, height).focal_px / scale;
    const Eigen::Vector2d middle((width - 1) / 2.0, (height - 1) / 2.0);
    const double corner = (middle.norm() + 1) / focal;
    constexpr int kPlaces = 400;
    Eigen::MatrixX3d powers(kPlaces, 3);
    Eigen::VectorXd off(kPlaces);
    for (int place = 0; place < kPlaces; ++place) {
      const double shown = corner * (place + 1) / kPlaces;
      const double of_corner2 = std::pow(shown * focal, 2) / middle.squaredNorm();
      const double truth = shown * (1 + drawn_in * of_corner2);
      powers.row(place) << std::pow(truth, 3), std::pow(truth, 5), std::pow(truth, 7);
      off[place] = shown - truth;
    }
    const Eigen::Vector3d k = powers.colPivHouseholderQr().solve(off);
    sim::LensCalibration lens;
    lens.width = width;
    lens.height = height;
    lens.focal_px = {focal, focal};
    lens.middle_px = middle;
    lens.coefficients = {k[0], k[1], 0, 0, k[2]};
    return lens;
  }
};

}  // namespace kiroku::test
