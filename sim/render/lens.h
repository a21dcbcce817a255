// The lens of an endoscope as a calibration has it: where the recorded picture shows what a camera without
// distortion sees, and back. Objects are immutable and thread-safe.
//
// Places in the plane are at distance 1 before the camera, x to the right, y down. Pixels count from the
// centre of the left upper one, x to the right, y down, in a picture of the calibration's size.
//
// Source: Brown, "Close-Range Camera Calibration" (Photogrammetric Engineering 1971), and for a fisheye
// Kannala and Brandt, "A Generic Camera Model and Calibration Method for Conventional, Wide-Angle, and
// Fish-Eye Lenses" (PAMI 2006), both as OpenCV's calib3d has them.
#pragma once

#include <array>
#include <optional>
#include <string>

#include <Eigen/Core>

namespace kiroku::sim {

enum class LensModel { kBrown, kFisheye };
/// A word for documents: "brown", "fisheye".
const char* name_of(LensModel model);

struct LensCalibration {
  LensModel model = LensModel::kBrown;
  int width = 0, height = 0;  // of the pictures that it was made of
  Eigen::Vector2d focal_px = Eigen::Vector2d::Zero(), middle_px = Eigen::Vector2d::Zero();
  std::array<double, 5> coefficients{};  // k1, k2, p1, p2, k3; of a fisheye k1 to k4, and 0
};

class Lens {
 public:
  /// kiroku::UsageError in a sentence: a number that is none, a picture's middle or a focal length that no
  /// camera has, a distortion that is not monotone within the picture, and a field of view beyond
  /// kLeastFieldDeg or 80 degrees off the axis.
  explicit Lens(const LensCalibration& calibration);

  [[nodiscard]] const LensCalibration& calibration() const { return calibration_; }
  /// Where the picture shows a place. Beyond reach() evenly outwards, as a polynomial would fold back there.
  [[nodiscard]] Eigen::Vector2d pixel_of(const Eigen::Vector2d& plane) const;
  /// The place that a pixel of the picture shows, to 1e-9; also half a pixel beyond its border.
  [[nodiscard]] Eigen::Vector2d plane_of(const Eigen::Vector2d& pixel) const;

  /// How far from the axis the picture shows anything, in the plane.
  [[nodiscard]] double reach() const { return reach_; }
  /// By how much the lens shows the farthest corner nearer to the axis than a camera without distortion does,
  /// as a share of where that shows it: positive for barrel, negative for pincushion distortion.
  [[nodiscard]] double drawn_in() const { return drawn_in_; }
  /// Of the lesser side of the ideal camera's picture: it has the size of the recorded one, square pixels,
  /// its axis through the middle, no distortion, and is the largest that the recorded picture fills. Parts of
  /// the recorded corners lie beyond it where the distortion is barrel.
  [[nodiscard]] double field_deg() const { return field_deg_; }
  /// Of the least such camera that sees all that the recorded picture shows.
  [[nodiscard]] double whole_field_deg() const { return whole_field_deg_; }

  /// kiroku::UsageError for pictures of another shape than the calibration's, by more than a pixel.
  void require_shape(int width, int height) const;

  static constexpr double kLeastFieldDeg = 10, kGreatestFieldDeg = 120;

 private:
  [[nodiscard]] double shown_radius(double radius) const;
  [[nodiscard]] double slope(double radius) const;
  [[nodiscard]] std::optional<double> true_radius(double shown) const;
  [[nodiscard]] Eigen::Vector2d decentred(const Eigen::Vector2d& plane) const;
  [[nodiscard]] Eigen::Vector2d distorted(const Eigen::Vector2d& plane) const;
  [[nodiscard]] std::optional<Eigen::Vector2d> undistorted(const Eigen::Vector2d& shown) const;
  [[nodiscard]] bool is_filled(double half_tangent) const;
  void find_limit();
  void find_reach();
  void find_field();

  LensCalibration calibration_;
  double limit_ = 0;        // radius up to which the radial distortion is monotone
  double limit_shown_ = 0;  // of it
  double reach_ = 0, drawn_in_ = 0, field_deg_ = 0, whole_field_deg_ = 0;
};

}  // namespace kiroku::sim
