#include "sim/align/lens_calibrator.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <string>

#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::sim {
namespace {

using Corners = std::vector<Eigen::Vector2f>;

/// Root of the mean squared distance, in the order in which both were found or the other way round.
double apart_px(const Corners& a, const Corners& b) {
  double along = 0, against = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    along += double((a[i] - b[i]).squaredNorm());
    against += double((a[i] - b[b.size() - 1 - i]).squaredNorm());
  }
  return std::sqrt(std::min(along, against) / double(a.size()));
}

constexpr double kDegrees = 180 / std::numbers::pi;

/// Between the normals of the two boards that differ most.
double largest_tilt_deg(const std::vector<cv::Mat>& rotations) {
  std::vector<cv::Vec3d> normals;
  for (const cv::Mat& rotation : rotations) {
    cv::Matx33d turn;
    cv::Rodrigues(rotation, turn);
    normals.emplace_back(turn(0, 2), turn(1, 2), turn(2, 2));
  }
  double least = 1;
  for (const cv::Vec3d& a : normals) {
    for (const cv::Vec3d& b : normals) least = std::min(least, std::abs(a.dot(b)));
  }
  return kDegrees * std::acos(std::min(1.0, least));
}

}  // namespace

LensCalibrator::LensCalibrator(int columns, int rows) : columns_(columns), rows_(rows) {
  constexpr int kLeast = 3, kMost = 50;
  if (std::min(columns, rows) < kLeast || std::max(columns, rows) > kMost || columns == rows) {
    throw UsageError(
        "a board has 3 to 50 inner corners in each direction, and not as many in both: 9x6 is one "
        "of 10 x 7 squares");
  }
}

LensCalibrator::Taken LensCalibrator::take(int width, int height, std::span<const std::uint8_t> grey) {
  if (width_ == 0) {
    width_ = width;
    height_ = height;
  }
  if (width != width_ || height != height_) {
    throw UsageError("a picture of " + std::to_string(width) + "x" + std::to_string(height) +
                     " pixels follows some of " + std::to_string(width_) + "x" + std::to_string(height_) +
                     ": a lens is calibrated with pictures of one size");
  }
  constexpr int kLeastSide = 16;  // in less OpenCV finds no board, and says so in its own words
  if (std::min(width, height) < kLeastSide) return Taken::kNoBoard;
  const cv::Mat picture(height, width, CV_8UC1, const_cast<std::uint8_t*>(grey.data()));
  std::vector<cv::Point2f> found;
  if (!cv::findChessboardCornersSB(picture, {columns_, rows_}, found,
                                   cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_ACCURACY))
    return Taken::kNoBoard;
  Corners corners;
  for (const cv::Point2f& corner : found) corners.emplace_back(corner.x, corner.y);
  constexpr double kAlike = 0.02;  // of the picture's width
  const bool is_alike = std::ranges::any_of(
      boards_, [&](const Corners& used) { return apart_px(used, corners) < kAlike * width; });
  if (is_alike) return Taken::kAlike;
  boards_.push_back(std::move(corners));
  return Taken::kUsed;
}

void LensCalibrator::require_poses() const {
  if (boards_.size() < kLeastPictures) {
    throw UsageError(
        "the whole board lies differently in " + counted(boards_.size(), "picture", "pictures") +
        " only: " + std::to_string(kLeastPictures) +
        " at least are needed, with the board tilted to all sides, and in the picture's corners");
  }
  const Eigen::Vector2f middle(float(width_ - 1) / 2, float(height_ - 1) / 2);
  float farthest = 0;
  for (const Corners& board : boards_) {
    for (const Eigen::Vector2f& corner : board) farthest = std::max(farthest, (corner - middle).norm());
  }
  constexpr float kLeast = 0.75F;
  if (farthest < kLeast * middle.norm()) {
    throw UsageError(
        "the board is never near a corner of the picture, where a lens bends most: its farthest "
        "corner is at " +
        number_text(100 * double(farthest / middle.norm()), 2) + " % of the way there, and 75 % are needed");
  }
}

LensCalibrator::Result LensCalibrator::solve() const {
  require_poses();
  std::vector<cv::Point3f> board;
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) board.emplace_back(float(column), float(row), 0.F);
  }
  const std::vector<std::vector<cv::Point3f>> places(boards_.size(), board);
  std::vector<std::vector<cv::Point2f>> pixels;
  for (const Corners& corners : boards_) {
    pixels.emplace_back();
    for (const Eigen::Vector2f& corner : corners) pixels.back().emplace_back(corner.x(), corner.y());
  }
  cv::Mat_<double> camera, distortion, error_of_camera, error_of_poses, of_picture;
  std::vector<cv::Mat> rotations, translations;
  Result result;
  try {
    constexpr int kMostSteps = 200;
    constexpr double kLeastChange = 1e-12;
    result.rms_px = cv::calibrateCamera(
        places, pixels, {width_, height_}, camera, distortion, rotations, translations, error_of_camera,
        error_of_poses, of_picture, 0,
        cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, kMostSteps, kLeastChange));
  } catch (const cv::Exception&) {
    throw UsageError("no lens shows the board as the pictures do: is --board what it has?");
  }
  constexpr double kLeastTiltDeg = 20, kMostFocalError = 0.01, kMostRms = 1.0 / 200;
  if (!(result.rms_px <= kMostRms * width_)) {
    throw UsageError("no lens shows the board as the pictures do: the best one is " +
                     number_text(result.rms_px, 3) +
                     " pixels off. Is the board flat, and was the endoscope neither zoomed nor focused?");
  }
  const double tilt_deg = largest_tilt_deg(rotations);
  result.focal_error = std::max(error_of_camera(0) / camera(0, 0), error_of_camera(1) / camera(1, 1));
  if (!(tilt_deg >= kLeastTiltDeg) || !(result.focal_error <= kMostFocalError)) {
    throw UsageError("the board lies too much alike in all pictures: tilts differ by " +
                     number_text(tilt_deg, 2) + " degrees (20 are needed), and the focal length is open by " +
                     number_text(100 * result.focal_error, 2) +
                     " % (1 % at most): tilt it by 30 degrees to all sides");
  }
  LensCalibration& lens = result.lens;
  lens.width = width_;
  lens.height = height_;
  lens.focal_px = {camera(0, 0), camera(1, 1)};
  lens.middle_px = {camera(0, 2), camera(1, 2)};
  for (int i = 0; i < 5; ++i) lens.coefficients[static_cast<std::size_t>(i)] = distortion(i);
  for (int i = 0; i < of_picture.rows; ++i) result.error_px.push_back(of_picture(i));
  (void)Lens(lens);  // refuses one that is of no use
  return result;
}

}  // namespace kiroku::sim
