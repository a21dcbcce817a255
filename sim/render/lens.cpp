#include "sim/render/lens.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/LU>

#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::sim {
namespace {

using Eigen::Vector2d;

/// What is further off the axis is none of a picture that an ideal camera can have.
const double kMostRadius = std::tan(80 * std::numbers::pi / 180);

double tangent_of(double field_deg) { return std::tan(field_deg * std::numbers::pi / 360); }
double field_of(double tangent) { return std::atan(tangent) * 360 / std::numbers::pi; }

std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

/// Places over a picture, its border among them.
template <typename Take>
void for_each_place(int width, int height, Take&& take) {
  constexpr int kAcross = 32, kDown = 24;
  for (int row = 0; row <= kDown; ++row) {
    for (int column = 0; column <= kAcross; ++column)
      take(Vector2d(-0.5 + double(width) * column / kAcross, -0.5 + double(height) * row / kDown));
  }
}

void require_camera(const LensCalibration& lens) {
  if (lens.width < 16 || lens.height < 16 || lens.width > 65536 || lens.height > 65536)
    throw UsageError("the lens is of pictures of " + size_text(lens.width, lens.height) +
                     " pixels: from 16 to 65536 each side are possible");
  if (!lens.focal_px.allFinite() || !lens.middle_px.allFinite() ||
      !std::ranges::all_of(lens.coefficients, [](double one) { return std::isfinite(one); }))
    throw UsageError("the lens has a number that is infinite or none (NaN): calibrate it anew");
  const double ratio = lens.focal_px.x() / lens.focal_px.y();
  if (!(lens.focal_px.minCoeff() > 0) || !(ratio > 0.5 && ratio < 2))
    throw UsageError("the lens has focal lengths of " + number_text(lens.focal_px.x(), 5) + " and " +
                     number_text(lens.focal_px.y(), 5) +
                     " pixels: both must be positive, and neither twice the other");
  const Vector2d share = lens.middle_px.cwiseQuotient(Vector2d(lens.width, lens.height));
  if (!(share.minCoeff() > 0.25 && share.maxCoeff() < 0.75))
    throw UsageError("the lens has its axis at the pixel " + number_text(lens.middle_px.x(), 5) + ", " +
                     number_text(lens.middle_px.y(), 5) + " of pictures of " +
                     size_text(lens.width, lens.height) + ": that is not near their middle");
}

}  // namespace

const char* name_of(LensModel model) { return model == LensModel::kFisheye ? "fisheye" : "brown"; }

Lens::Lens(const LensCalibration& calibration) : calibration_(calibration) {
  require_camera(calibration_);
  find_limit();
  find_reach();
  find_field();
}

double Lens::shown_radius(double radius) const {
  const auto& k = calibration_.coefficients;
  if (calibration_.model == LensModel::kFisheye) {
    const double angle = std::atan(radius), square = angle * angle;
    return angle * (1 + square * (k[0] + square * (k[1] + square * (k[2] + square * k[3]))));
  }
  const double square = radius * radius;
  return radius * (1 + square * (k[0] + square * (k[1] + square * k[4])));
}

double Lens::slope(double radius) const {
  const auto& k = calibration_.coefficients;
  const double square = radius * radius;
  if (calibration_.model == LensModel::kFisheye) {
    const double angle = std::atan(radius), turned = angle * angle;
    return (1 + turned * (3 * k[0] + turned * (5 * k[1] + turned * (7 * k[2] + turned * 9 * k[3])))) /
           (1 + square);
  }
  return 1 + square * (3 * k[0] + square * (5 * k[1] + square * 7 * k[4]));
}

void Lens::find_limit() {
  constexpr int kSteps = 4000;
  limit_ = kMostRadius;
  for (int step = 1; step <= kSteps; ++step) {
    const double radius = kMostRadius * step / kSteps;
    if (slope(radius) > 0) continue;
    double low = kMostRadius * (step - 1) / kSteps, high = radius;
    for (int halving = 0; halving < 50; ++halving) {
      const double middle = (low + high) / 2;
      (slope(middle) > 0 ? low : high) = middle;
    }
    limit_ = low;
    break;
  }
  limit_shown_ = shown_radius(limit_);
}

std::optional<double> Lens::true_radius(double shown) const {
  if (!(shown <= limit_shown_)) return {};
  // Newton's method, kept between what is too near and what is too far.
  double low = 0, high = limit_, radius = std::min(shown, limit_);
  constexpr int kMostSteps = 100;
  for (int step = 0; step < kMostSteps; ++step) {
    const double off = shown_radius(radius) - shown;
    (off > 0 ? high : low) = radius;
    double next = radius - off / slope(radius);
    if (!(next > low && next < high)) next = (low + high) / 2;
    const bool done = std::abs(next - radius) <= 4 * std::numeric_limits<double>::epsilon() * (1 + radius);
    radius = next;
    if (done) break;
  }
  return radius;
}

Vector2d Lens::decentred(const Vector2d& plane) const {
  if (calibration_.model == LensModel::kFisheye) return Vector2d::Zero();
  const double p1 = calibration_.coefficients[2], p2 = calibration_.coefficients[3];
  const double x = plane.x(), y = plane.y(), square = plane.squaredNorm();
  return {2 * p1 * x * y + p2 * (square + 2 * x * x), p1 * (square + 2 * y * y) + 2 * p2 * x * y};
}

Vector2d Lens::distorted(const Vector2d& plane) const {
  const double radius = plane.norm();
  const double scale = radius > 0 ? shown_radius(radius) / radius : 1;
  return scale * plane + decentred(plane);
}

std::optional<Vector2d> Lens::undistorted(const Vector2d& shown) const {
  // What is decentred is small: it is taken off as of the place that was found before.
  Vector2d plane = shown;
  constexpr int kMostSteps = 100;
  for (int step = 0; step < kMostSteps; ++step) {
    const Vector2d radial = shown - decentred(plane);
    const double length = radial.norm();
    const auto radius = true_radius(length);
    if (!radius) return {};
    const Vector2d next = length > 0 ? Vector2d(*radius / length * radial) : Vector2d::Zero();
    const bool done = (next - plane).norm() <= 1e-13 * (1 + *radius);
    plane = next;
    if (done) return plane;
  }
  return {};
}

Vector2d Lens::pixel_of(const Vector2d& plane) const {
  const double radius = plane.norm();
  const double beyond = radius > reach_ ? radius / reach_ : 1;
  return (beyond * distorted(plane / beyond)).cwiseProduct(calibration_.focal_px) + calibration_.middle_px;
}

Vector2d Lens::plane_of(const Vector2d& pixel) const {
  const Vector2d low(-0.5, -0.5), high(calibration_.width - 0.5, calibration_.height - 0.5);
  const Vector2d within = pixel.cwiseMax(low).cwiseMin(high);
  const Vector2d shown = (within - calibration_.middle_px).cwiseQuotient(calibration_.focal_px);
  // Within the picture there is one, or the object would not be.
  return undistorted(shown).value_or(shown);
}

void Lens::find_reach() {
  for_each_place(calibration_.width, calibration_.height, [&](const Vector2d& pixel) {
    const Vector2d shown = (pixel - calibration_.middle_px).cwiseQuotient(calibration_.focal_px);
    const auto plane = undistorted(shown);
    bool folds = !plane;
    if (plane) {
      constexpr double kStep = 1e-6;
      Eigen::Matrix2d change;
      for (int axis = 0; axis < 2; ++axis) {
        const Vector2d step = kStep * Vector2d::Unit(axis);
        change.col(axis) = (distorted(*plane + step) - distorted(*plane - step)) / (2 * kStep);
      }
      folds = !(change.determinant() > 0);
    }
    if (folds) {
      throw UsageError("the lens's distortion is not monotone within the picture: about the pixel " +
                       number_text(pixel.x(), 4) + ", " + number_text(pixel.y(), 4) + " of " +
                       size_text(calibration_.width, calibration_.height) +
                       " it folds back, or shows what lies more than 80 degrees off the axis; calibrate it "
                       "anew with the board also in the pictures' corners");
    }
    if (plane->norm() <= reach_) return;
    reach_ = plane->norm();
    drawn_in_ = 1 - shown.norm() / reach_;
  });
}

bool Lens::is_filled(double half_tangent) const {
  const int width = calibration_.width, height = calibration_.height;
  const double focal = std::min(width, height) / 2.0 / half_tangent;
  constexpr int kPlaces = 64;
  constexpr double kRounding = 1e-9;
  for (int place = 0; place <= kPlaces; ++place) {
    const double along = 2.0 * place / kPlaces - 1;
    for (const Vector2d& at :
         {Vector2d(along, -1), Vector2d(along, 1), Vector2d(-1, along), Vector2d(1, along)}) {
      const Vector2d plane = at.cwiseProduct(Vector2d(width - 1, height - 1)) / (2 * focal);
      const Vector2d pixel = pixel_of(plane);
      if (!(pixel.minCoeff() >= -kRounding && pixel.x() <= width - 1 + kRounding &&
            pixel.y() <= height - 1 + kRounding))
        return false;
    }
  }
  return true;
}

void Lens::find_field() {
  double low = tangent_of(kLeastFieldDeg), high = tangent_of(kGreatestFieldDeg);
  if (!is_filled(low)) {
    throw UsageError("the lens shows less than " + number_text(kLeastFieldDeg, 3) +
                     " degrees about its axis: that is no endoscope's");
  }
  if (is_filled(high)) low = high;
  for (int halving = 0; halving < 60 && low < high; ++halving) {
    const double middle = (low + high) / 2;
    (is_filled(middle) ? low : high) = middle;
  }
  field_deg_ = field_of(low);
  Vector2d most = Vector2d::Zero();
  for_each_place(calibration_.width, calibration_.height,
                 [&](const Vector2d& pixel) { most = most.cwiseMax(plane_of(pixel).cwiseAbs()); });
  const Vector2d half(calibration_.width / 2.0, calibration_.height / 2.0);
  whole_field_deg_ = field_of(half.minCoeff() * most.cwiseQuotient(half).maxCoeff());
}

void Lens::require_shape(int width, int height) const {
  const double of_width = double(calibration_.height) * width / calibration_.width;
  const double of_height = double(calibration_.width) * height / calibration_.height;
  if (std::abs(of_width - height) <= 1 || std::abs(of_height - width) <= 1) return;
  throw UsageError("the recorded pictures have " + size_text(width, height) +
                   " pixels, but the lens was calibrated with " +
                   size_text(calibration_.width, calibration_.height) +
                   ", which is another shape: calibrate it with pictures as they are recorded");
}

}  // namespace kiroku::sim
