#include "viewer/compare/registration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <string>

#include <Eigen/SVD>

#include "base/error.h"

namespace kiroku::compare {
namespace {

/// Distances are in millimetres inside: an organ's size is far from 1 in metres.
constexpr double kMillimetres = 1000;
constexpr double kLeastFieldDeg = 10, kGreatestFieldDeg = 120;

/// How far the points reach around their middle, in each direction, the longest first.
template <typename Points>
Eigen::VectorXd extents(const Points& points) {
  const Eigen::MatrixXd centred = points.colwise() - points.rowwise().mean();
  return Eigen::JacobiSVD<Eigen::MatrixXd>(centred).singularValues() / std::sqrt(double(points.cols()));
}

struct Points {
  std::vector<cv::Point3d> organ;  // mm
  std::vector<cv::Point2d> picture;
  bool in_a_plane = false;
};

Points sound_points(std::span<const PickedPoint> picked, int width, int height) {
  if (picked.size() < kLeastPoints) {
    throw UsageError("the camera cannot be found from " + std::to_string(picked.size()) +
                     " points: pick at least " + std::to_string(kLeastPoints) +
                     " on the organ and in the picture");
  }
  Points points;
  Eigen::Matrix3Xd organ(3, static_cast<Eigen::Index>(picked.size()));
  Eigen::Matrix2Xd picture(2, static_cast<Eigen::Index>(picked.size()));
  for (std::size_t i = 0; i < picked.size(); ++i) {
    const Eigen::Vector2d& pixel = picked[i].pixel;
    if (!picked[i].organ_m.allFinite() || !pixel.allFinite() || pixel.x() < -0.5 || pixel.y() < -0.5 ||
        pixel.x() > width - 0.5 || pixel.y() > height - 0.5)
      throw UsageError("picked point " + std::to_string(i + 1) + " lies outside the picture of " +
                       std::to_string(width) + "x" + std::to_string(height) + " pixels");
    const sim::Vector3 at_mm = picked[i].organ_m * kMillimetres;
    organ.col(static_cast<Eigen::Index>(i)) = at_mm;
    picture.col(static_cast<Eigen::Index>(i)) = pixel;
    points.organ.emplace_back(at_mm.x(), at_mm.y(), at_mm.z());
    points.picture.emplace_back(pixel.x(), pixel.y());
  }
  // Thinner than this, a cloud of points is a line or a plane to anybody who clicks.
  constexpr double kThin = 0.02, kLeastPixels = 2;
  const Eigen::VectorXd in_space = extents(organ), on_picture = extents(picture);
  if (in_space[1] <= kThin * in_space[0] || on_picture[1] <= std::max(kThin * on_picture[0], kLeastPixels)) {
    throw UsageError(
        "the picked points lie on one line or in one spot, on the organ or in the picture: any camera could "
        "be turned about it; pick points apart from it");
  }
  points.in_a_plane = in_space[2] <= kThin * in_space[0];
  return points;
}

double focal_px(double field_deg, int width, int height) {
  return std::min(width, height) / 2.0 / std::tan(field_deg * std::numbers::pi / 360);
}

cv::Matx33d lens_of(double field_deg, int width, int height) {
  const double focal = focal_px(field_deg, width, height);
  return {focal, 0, (width - 1) / 2.0, 0, focal, (height - 1) / 2.0, 0, 0, 1};
}

/// From the organ into OpenCV's camera: x right, y down, z ahead; mm.
struct Solution {
  cv::Vec3d rotation, translation;
  std::vector<double> error_px;
  double rms_px = std::numeric_limits<double>::infinity();  // of a camera that sees a point from behind
};

void refine(const Points& points, const cv::Matx33d& lens, Solution& solution) {
  cv::solvePnPRefineLM(points.organ, points.picture, lens, cv::noArray(), solution.rotation,
                       solution.translation);
  std::vector<cv::Point2d> seen;
  cv::projectPoints(points.organ, solution.rotation, solution.translation, lens, cv::noArray(), seen);
  cv::Matx33d turn;
  cv::Rodrigues(solution.rotation, turn);
  double sum = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const cv::Vec3d at =
        turn * cv::Vec3d(points.organ[i].x, points.organ[i].y, points.organ[i].z) + solution.translation;
    const double error = cv::norm(seen[i] - points.picture[i]);
    if (!(at[2] > 0) || !std::isfinite(error)) return;
    solution.error_px.push_back(error);
    sum += error * error;
  }
  solution.rms_px = std::sqrt(sum / double(seen.size()));
}

/// The best first.
std::vector<Solution> solutions(const Points& points, const cv::Matx33d& lens) {
  std::vector<cv::Vec3d> rotations, translations;
  std::vector<Solution> all;
  try {
    cv::solvePnPGeneric(points.organ, points.picture, lens, cv::noArray(), rotations, translations, false,
                        points.in_a_plane ? cv::SOLVEPNP_IPPE : cv::SOLVEPNP_SQPNP);
    for (std::size_t i = 0; i < rotations.size(); ++i) {
      Solution& solution = all.emplace_back();
      solution.rotation = rotations[i];
      solution.translation = translations[i];
      refine(points, lens, solution);
    }
  } catch (const cv::Exception&) {
    // OpenCV's word for points from which no camera comes; what there is by then is judged by its error.
  }
  std::ranges::sort(all, {}, &Solution::rms_px);
  return all;
}

/// Seen from far or straight on, a plane looks alike from two sides.
bool look_alike(const Solution& best, const Solution& other) {
  constexpr double kClearly = 2, kClickPx = 0.5, kSameTurn = 0.02;
  cv::Matx33d turn, other_turn;
  cv::Rodrigues(best.rotation, turn);
  cv::Rodrigues(other.rotation, other_turn);
  // Both may have been refined into one.
  return cv::norm(turn - other_turn) > kSameTurn && other.rms_px < kClearly * best.rms_px + kClickPx;
}

/// The least error over the angle: looked for on a grid, then by golden sections.
double estimated_field_deg(const Points& points, int width, int height) {
  constexpr double kStepDeg = 5, kToleranceDeg = 1e-4;
  const auto error_at = [&](double field_deg) {
    const std::vector<Solution> all = solutions(points, lens_of(field_deg, width, height));
    return all.empty() ? std::numeric_limits<double>::infinity() : all.front().rms_px;
  };
  double best_deg = kLeastFieldDeg, least = std::numeric_limits<double>::infinity();
  for (double field_deg = kLeastFieldDeg; field_deg <= kGreatestFieldDeg; field_deg += kStepDeg) {
    if (const double here = error_at(field_deg); here < least) {
      least = here;
      best_deg = field_deg;
    }
  }
  double low = std::max(kLeastFieldDeg, best_deg - kStepDeg);
  double high = std::min(kGreatestFieldDeg, best_deg + kStepDeg);
  const double ratio = std::numbers::phi - 1;
  double a = high - ratio * (high - low), b = low + ratio * (high - low);
  double at_a = error_at(a), at_b = error_at(b);
  while (high - low > kToleranceDeg) {
    if (at_a <= at_b) {
      high = b;
      b = a;
      at_b = at_a;
      a = high - ratio * (high - low);
      at_a = error_at(a);
    } else {
      low = a;
      a = b;
      at_a = at_b;
      b = low + ratio * (high - low);
      at_b = error_at(b);
    }
  }
  return (low + high) / 2;
}

sim::Camera camera_of(const Solution& solution, double field_deg, int width, int height) {
  cv::Matx33d turn;
  cv::Rodrigues(solution.rotation, turn);
  const cv::Vec3d eye_mm = -(turn.t() * solution.translation);
  sim::Camera camera;
  camera.eye_m = sim::Vector3(eye_mm[0], eye_mm[1], eye_mm[2]) / kMillimetres;
  // The view's y and z point the other way.
  for (int row = 0; row < 3; ++row) {
    const double sign = row == 0 ? 1 : -1;
    for (int column = 0; column < 3; ++column) camera.to_view(row, column) = sign * turn(row, column);
  }
  const double focal = focal_px(field_deg, width, height);
  camera.half_extent = {width / 2.0 / focal, height / 2.0 / focal};
  return camera;
}

}  // namespace

Registration register_camera(std::span<const PickedPoint> picked, int width, int height,
                             std::optional<double> field_deg) {
  const Points points = sound_points(picked, width, height);
  Registration registration;
  registration.field_estimated = !field_deg;
  if (field_deg && !(*field_deg >= kLeastFieldDeg && *field_deg <= kGreatestFieldDeg))
    throw UsageError("the field of view must be from 10 to 120 degrees");
  if (!field_deg) {
    if (picked.size() < kLeastPointsForField || points.in_a_plane) {
      throw UsageError(
          "the field of view cannot be estimated from fewer than 6 points, or from points in one plane: pick "
          "more, or state it");
    }
    field_deg = estimated_field_deg(points, width, height);
  }
  const std::vector<Solution> all = solutions(points, lens_of(*field_deg, width, height));
  if (all.empty() || !std::isfinite(all.front().rms_px)) {
    throw UsageError(
        "no camera sees the picked points where they were picked: some are not the same on the organ and in "
        "the picture, or in another order");
  }
  if (points.in_a_plane && all.size() > 1 && look_alike(all[0], all[1])) {
    throw UsageError(
        "the picked points lie in a plane that two cameras see alike: pick a point in front of it or behind");
  }
  registration.camera = camera_of(all.front(), *field_deg, width, height);
  registration.field_deg = *field_deg;
  registration.error_px = all.front().error_px;
  registration.rms_px = all.front().rms_px;
  return registration;
}

std::optional<Eigen::Vector2d> pixel_of(const sim::Camera& camera, const sim::Vector3& point_m, int width,
                                        int height) {
  const sim::Vector3 view_m = camera.view_m(point_m);
  if (!camera.parallel && !(view_m.z() < 0)) return {};
  const double depth = camera.parallel ? 1 : -view_m.z();
  const Eigen::Vector2d plane = view_m.head<2>() / depth - camera.centre;
  const double s = plane.x() / camera.half_extent.x(), t = plane.y() / camera.half_extent.y();
  return Eigen::Vector2d((s + 1) / 2 * width - 0.5, (1 - t) / 2 * height - 0.5);
}

}  // namespace kiroku::compare
