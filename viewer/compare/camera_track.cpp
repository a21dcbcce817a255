#include "viewer/compare/camera_track.h"

#include <algorithm>
#include <utility>

#include "base/error.h"

namespace kiroku::compare {

namespace {

/// Points that are held within this of where the camera sees them agree with it.
constexpr double kAgreePx = 0.75;
/// A point that is farther from where the others have it was taken along by what passed over it.
constexpr double kAstrayPx = 1.5;
/// As many must agree without it: fewer would agree with many a camera.
constexpr std::size_t kLeastAgreeing = 5;

}  // namespace

CameraTrack::CameraTrack(PickedRegistration picked, int width, int height)
    : picked_(std::move(picked)),
      width_(width),
      height_(height),
      registration_(register_camera(picked_.points, width, height, picked_.field_deg)),
      largest_rms_px_(registration_.rms_px) {}

void CameraTrack::begin_hold(std::int64_t time_ns, const media::PictureView& picture) {
  std::vector<Eigen::Vector2d> pixels;
  for (const PickedPoint& point : picked_.points) pixels.push_back(point.pixel);
  hold_ = std::make_unique<PointHold>(picture, pixels);
  moments_.push_back({time_ns, registration_.camera});
}

void CameraTrack::take(std::int64_t time_ns, const media::PictureView& picture) {
  if (!hold_) {
    // The picked picture is the one that was still shown at the picked time.
    if (time_ns > picked_.time_ns && !before_.empty()) {
      begin_hold(before_ns_, {width_, height_, picture.channels, before_});
      before_ = {};
    } else {
      before_.assign(picture.samples.begin(), picture.samples.end());
      before_ns_ = time_ns;
      return;
    }
  }
  follow(time_ns, picture);
}

void CameraTrack::finish() {
  if (!hold_) moments_.push_back({before_ns_, registration_.camera});
}

void CameraTrack::follow(std::int64_t time_ns, const media::PictureView& picture) {
  if (lost_ns_) return;
  hold_->follow(picture);
  std::vector<PickedPoint> held;
  std::vector<std::size_t> which;
  for (std::size_t i = 0; i < picked_.points.size(); ++i) {
    if (!hold_->points()[i]) continue;
    held.push_back({picked_.points[i].organ_m, *hold_->points()[i]});
    which.push_back(i);
  }
  try {
    Registration now = register_camera(held, width_, height_, registration_.field_deg);
    while (const auto astray = without_astray(held, now)) {
      hold_->drop(which[*astray]);
      which.erase(which.begin() + static_cast<std::ptrdiff_t>(*astray));
    }
    if (now.rms_px <= kLostPx) {
      largest_rms_px_ = std::max(largest_rms_px_, now.rms_px);
      moments_.push_back({time_ns, now.camera});
      return;
    }
  } catch (const UsageError&) {
    // What is still held does not make a camera.
  }
  lost_ns_ = time_ns;
}

std::optional<std::size_t> CameraTrack::without_astray(std::vector<PickedPoint>& held,
                                                       Registration& now) const {
  if (held.size() <= kLeastAgreeing || std::ranges::max(now.error_px) <= kAgreePx) return {};
  std::optional<std::size_t> astray;
  Registration best;
  for (std::size_t i = 0; i < held.size(); ++i) {
    std::vector<PickedPoint> others = held;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    try {
      Registration without = register_camera(others, width_, height_, registration_.field_deg);
      if (astray && without.rms_px >= best.rms_px) continue;
      best = std::move(without);
      astray = i;
    } catch (const UsageError&) {
      // The others alone make no camera.
    }
  }
  if (!astray || std::ranges::max(best.error_px) > kAgreePx) return {};
  const auto expected = pixel_of(best.camera, held[*astray].organ_m, width_, height_);
  if (expected && (*expected - held[*astray].pixel).norm() <= kAstrayPx) return {};
  held.erase(held.begin() + static_cast<std::ptrdiff_t>(*astray));
  now = std::move(best);
  return astray;
}

const sim::Camera& CameraTrack::camera_at(std::int64_t time_ns) const {
  const auto after = std::ranges::upper_bound(moments_, time_ns, {}, &Moment::time_ns);
  if (after != moments_.begin()) return std::prev(after)->camera;
  return registration_.camera;
}

bool CameraTrack::held_at(std::int64_t time_ns) const {
  return !moments_.empty() && time_ns >= moments_.front().time_ns && (!lost_ns_ || time_ns < *lost_ns_);
}

}  // namespace kiroku::compare
