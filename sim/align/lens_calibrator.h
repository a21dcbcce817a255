// A lens from pictures of a chessboard. An object belongs to one thread.
//
// Source: the board's corners by Duda and Frese, "Accurate Detection and Localization of Checkerboard Corners
// for Calibration" (BMVC 2018); the camera by Zhang, "A Flexible New Technique for Camera Calibration" (PAMI
// 2000); both as OpenCV has them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "sim/render/lens.h"

namespace kiroku::sim {

class LensCalibrator {
 public:
  /// Corners within the board, of which each joins four squares: a board of 10 x 7 squares has 9 x 6. How
  /// large the squares are does not matter: a lens has no length. kiroku::UsageError for fewer than 3 or more
  /// than 50 in a direction, and for as many in both: its turns could not be told apart.
  LensCalibrator(int columns, int rows);

  enum class Taken {
    kUsed,
    kNoBoard,  // not the whole board is found
    kAlike,    // it lies as in a picture that is used
  };
  /// Grey, (height x width), rows from the top. kiroku::UsageError for a picture of another size than the
  /// first.
  Taken take(int width, int height, std::span<const std::uint8_t> grey);
  /// Pictures that are used.
  [[nodiscard]] std::size_t used() const { return boards_.size(); }

  struct Result {
    LensCalibration lens;
    double rms_px = 0;             // between corners that were found and where the lens shows them
    std::vector<double> error_px;  // the same of each picture that is used, in order
    double focal_error = 0;        // standard error of the focal length, as a share of it
  };
  /// kiroku::UsageError in a sentence: fewer than kLeastPictures, boards of nearly one tilt, none near the
  /// picture's corners, a focal length that they leave open, and as sim::Lens.
  [[nodiscard]] Result solve() const;

  static constexpr std::size_t kLeastPictures = 8;

 private:
  void require_poses() const;

  int columns_, rows_;
  int width_ = 0, height_ = 0;
  std::vector<std::vector<Eigen::Vector2f>> boards_;  // (used, columns x rows), pixels
};

}  // namespace kiroku::sim
