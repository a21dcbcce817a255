#include "sim/align/surface_points.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include <Eigen/Cholesky>

namespace kiroku::sim {
namespace {

constexpr int kFlowLevels = 3, kWindowPx = 21;
constexpr double kReturnPx = 0.7;

cv::Mat grey_picture(const Picture& picture) {
  // OpenCV takes memory without const; nothing writes to it here.
  const cv::Mat given(picture.height, picture.width, CV_8UC3, const_cast<std::uint8_t*>(picture.rgb.data()));
  cv::Mat grey;
  cv::cvtColor(given, grey, cv::COLOR_RGB2GRAY);
  return grey;
}

struct FixedPoint {
  Vector3 organ_m;
  cv::Point2f pixel;
};

}  // namespace

struct SurfacePoints::State {
  cv::Mat grey;
  Cover cover;
  std::vector<cv::Mat> pyramid;
  std::vector<FixedPoint> points;
  std::size_t fixed = 0;
  int pictures = 0;  // since they were fixed
  Expected place;
};

SurfacePoints::SurfacePoints() : state_(std::make_unique<State>()) {}
SurfacePoints::~SurfacePoints() = default;

void SurfacePoints::drop() { state_->points.clear(); }

std::vector<SurfacePoints::Followed> SurfacePoints::followed() const {
  std::vector<Followed> all;
  for (const FixedPoint& point : state_->points)
    all.push_back({point.organ_m, {point.pixel.x, point.pixel.y}});
  return all;
}

bool SurfacePoints::worn() const {
  constexpr int kLong = 20;
  constexpr double kLeft = 0.6;
  return state_->pictures >= kLong || double(state_->points.size()) < kLeft * double(state_->fixed) ||
         state_->points.size() < 3 * kLeastPoints;
}

void SurfacePoints::follow(const Picture& picture, const Cover& cover) {
  State& state = *state_;
  cv::Mat grey = grey_picture(picture);
  std::vector<cv::Mat> pyramid;
  const cv::Size window(kWindowPx, kWindowPx);
  cv::buildOpticalFlowPyramid(grey, pyramid, window, kFlowLevels);
  if (!state.points.empty()) {
    std::vector<cv::Point2f> from, to, back;
    for (const FixedPoint& point : state.points) from.push_back(point.pixel);
    std::vector<unsigned char> found, returned;
    const cv::TermCriteria until(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 30, 0.01);
    cv::calcOpticalFlowPyrLK(state.pyramid, pyramid, from, to, found, cv::noArray(), window, kFlowLevels,
                             until);
    cv::calcOpticalFlowPyrLK(pyramid, state.pyramid, to, back, returned, cv::noArray(), window, kFlowLevels,
                             until);
    std::vector<FixedPoint> held;
    for (std::size_t i = 0; i < from.size(); ++i) {
      const bool inside = to[i].x >= 2 && to[i].y >= 2 && to[i].x < static_cast<float>(picture.width - 2) &&
                          to[i].y < static_cast<float>(picture.height - 2);
      if (found[i] != 0 && returned[i] != 0 && inside &&
          !cover.at(static_cast<int>(to[i].x), static_cast<int>(to[i].y)) &&
          cv::norm(back[i] - from[i]) <= kReturnPx)
        held.push_back({state.points[i].organ_m, to[i]});
    }
    state.points = std::move(held);
    ++state.pictures;
  }
  state.grey = std::move(grey);
  state.cover = cover;
  state.pyramid = std::move(pyramid);
}

std::optional<PointsFit> SurfacePoints::fit(const OrganSurface& surface, const Pinhole& pinhole) const {
  const State& state = *state_;
  if (state.points.size() < kLeastPoints) return {};
  PointsFit fit;
  fit.expected.camera = state.place.camera;
  MotionCovariance information;
  constexpr int kRounds = 12;
  constexpr double kBound = 3, kLeastScalePx = 0.3, kNormal = 1.4826;
  double scale_px = 0;
  for (int round = 0; round < kRounds; ++round) {
    const Camera& camera = fit.expected.camera;
    const Vector3 middle = camera.view_m(surface.middle_m);
    std::vector<Eigen::Vector2d> off;
    std::vector<double> sizes;
    for (const FixedPoint& point : state.points) {
      const Vector3 view = camera.view_m(point.organ_m);
      if (!(view.z() < 0)) return {};
      off.emplace_back(Eigen::Vector2d(point.pixel.x, point.pixel.y) - pinhole.pixel(view));
      sizes.push_back(off.back().norm());
    }
    std::vector<double> sorted = sizes;
    std::ranges::sort(sorted);
    scale_px = std::max(kLeastScalePx, kNormal / std::sqrt(2.0) * sorted[sorted.size() / 2]);
    information.setZero();
    Motion pull = Motion::Zero();
    double square = 0, agree = 0;
    for (std::size_t i = 0; i < off.size(); ++i) {
      const double bound = std::max(1.0, kBound * scale_px);
      // Cauchy's weight while it converges; what lies far off counts for nothing at the end.
      const double weight = 1 / (1 + sizes[i] * sizes[i] / (scale_px * scale_px)) / (scale_px * scale_px);
      const auto derivative =
          pinhole.derivative(camera.view_m(state.points[i].organ_m), middle, surface.radius_m);
      information += weight * derivative.transpose() * derivative;
      pull += weight * derivative.transpose() * off[i];
      if (sizes[i] <= bound) {
        agree += 1;
        square += sizes[i] * sizes[i];
      }
    }
    fit.points = static_cast<std::size_t>(agree);
    fit.share = agree / double(off.size());
    fit.misfit_px = agree > 0 ? std::sqrt(square / agree) : 0;
    const MotionCovariance damping = 1e-9 * information.trace() * MotionCovariance::Identity();
    const Motion step = (information + damping).ldlt().solve(pull);
    if (!step.allFinite() || step.norm() > surface.radius_m) return {};
    fit.expected.camera = after_motion(surface, camera, step);
    if (step.norm() < 1e-7) break;
  }
  if (fit.points < kLeastPoints) return {};
  // Flow's errors are shared by neighbours; of so many points one counts.
  constexpr double kShared = 4;
  const MotionCovariance since =
      kShared * (information + 1e-9 * information.trace() * MotionCovariance::Identity())
                    .ldlt()
                    .solve(MotionCovariance::Identity());
  fit.expected.covariance_m2 = state.place.covariance_m2 + since;
  return fit;
}

void SurfacePoints::fix(const OrganSurface& surface, const Pinhole& pinhole, const Expected& place) {
  State& state = *state_;
  state.points.clear();
  state.place = place;
  state.pictures = 0;
  constexpr int kShrink = 2, kFromBorderPx = 6;
  const auto silhouette =
      silhouette_of(surface, place.camera, pinhole, state.grey.cols, state.grey.rows, kShrink);
  state.fixed = 0;
  if (!silhouette) return;
  cv::Mat covered(silhouette->height, silhouette->width, CV_8U);
  for (int y = 0; y < covered.rows; ++y) {
    for (int x = 0; x < covered.cols; ++x)
      covered.at<std::uint8_t>(y, x) =
          silhouette->at(x, y) > 0 && !state.cover.at(kShrink * x, kShrink * y) ? 255 : 0;
  }
  const cv::Mat around = cv::getStructuringElement(
      cv::MORPH_ELLIPSE, {2 * kFromBorderPx / kShrink + 1, 2 * kFromBorderPx / kShrink + 1});
  cv::erode(covered, covered, around, {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  cv::Mat mask;
  cv::resize(covered, mask, state.grey.size(), 0, 0, cv::INTER_NEAREST);
  // What shines is the light's place and not the organ's.
  constexpr int kShining = 235;
  mask.setTo(0, state.grey > kShining);
  std::vector<cv::Point2f> corners;
  constexpr int kMost = 160;
  constexpr double kQuality = 0.01, kApartPx = 9;
  cv::goodFeaturesToTrack(state.grey, corners, kMost, kQuality, kApartPx, mask);
  for (const cv::Point2f& corner : corners) {
    const int x = std::min(silhouette->width - 1, static_cast<int>(corner.x) / kShrink),
              y = std::min(silhouette->height - 1, static_cast<int>(corner.y) / kShrink);
    const double depth = silhouette->at(x, y);
    if (!(depth > 0)) continue;
    const Vector3 view = pinhole.place_m({corner.x, corner.y}, depth);
    state.points.push_back({place.camera.eye_m + place.camera.to_view.transpose() * view, corner});
  }
  state.fixed = state.points.size();
}

}  // namespace kiroku::sim
