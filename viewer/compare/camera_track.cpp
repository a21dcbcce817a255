#include "viewer/compare/camera_track.h"

#include <algorithm>
#include <utility>

#include "base/error.h"

namespace kiroku::compare {

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
  for (std::size_t i = 0; i < picked_.points.size(); ++i) {
    if (hold_->points()[i]) held.push_back({picked_.points[i].organ_m, *hold_->points()[i]});
  }
  try {
    const Registration now = register_camera(held, width_, height_, registration_.field_deg);
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

const sim::Camera& CameraTrack::camera_at(std::int64_t time_ns) const {
  const auto after = std::ranges::upper_bound(moments_, time_ns, {}, &Moment::time_ns);
  if (after != moments_.begin()) return std::prev(after)->camera;
  return registration_.camera;
}

bool CameraTrack::held_at(std::int64_t time_ns) const {
  return !moments_.empty() && time_ns >= moments_.front().time_ns && (!lost_ns_ || time_ns < *lost_ns_);
}

}  // namespace kiroku::compare
