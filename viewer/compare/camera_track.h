// The registered camera over the pictures that follow the one it was registered in. An object belongs to one
// thread.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "archive/format/ledger_entry.h"
#include "media/png.h"
#include "viewer/compare/point_hold.h"
#include "viewer/compare/registration.h"

namespace kiroku::compare {

/// Points that a person picked, and in which picture.
struct PickedRegistration {
  std::int64_t time_ns = 0;  // the last picture that is not later
  std::vector<PickedPoint> points;
  std::optional<double> field_deg;  // of the picture's lesser side; nothing: to be estimated
};

class CameraTrack {
 public:
  /// Registers the picture of the size given. kiroku::UsageError as register_camera().
  CameraTrack(PickedRegistration picked, int width, int height);

  /// Every picture of the recording from before the picked one on, in order of time. From then on the points
  /// are held by optical flow and each picture is registered by those still held. One that a tool took along
  /// is dropped, for good, where at least five others agree without it. Once they are fewer than four, or the
  /// camera does not fit them within kLostPx, the registration is lost: from there on the last camera stands.
  void take(std::int64_t time_ns, const media::PictureView& picture);
  /// After the last picture.
  void finish();

  [[nodiscard]] const Registration& registration() const { return registration_; }
  /// The camera of a picture that was taken; before the picked one, and where the registration was lost, the
  /// nearest there is.
  [[nodiscard]] const sim::Camera& camera_at(std::int64_t time_ns) const;
  /// Whether camera_at() was registered in that picture.
  [[nodiscard]] bool held_at(std::int64_t time_ns) const;
  /// When it was lost; nothing while it is held.
  [[nodiscard]] std::optional<std::int64_t> lost_ns() const { return lost_ns_; }
  /// The largest error of a held picture.
  [[nodiscard]] double largest_rms_px() const { return largest_rms_px_; }

  static constexpr double kLostPx = 5;

 private:
  struct Moment {
    std::int64_t time_ns = 0;
    sim::Camera camera;
  };
  void begin_hold(std::int64_t time_ns, const media::PictureView& picture);
  void follow(std::int64_t time_ns, const media::PictureView& picture);
  /// Takes the point out of `held` that disagrees with all others, and registers `now` without it; which one.
  [[nodiscard]] std::optional<std::size_t> without_astray(std::vector<PickedPoint>& held,
                                                          Registration& now) const;

  PickedRegistration picked_;
  int width_, height_;
  Registration registration_;
  std::vector<std::uint8_t> before_;  // the picture before, until the hold begins
  std::int64_t before_ns_ = 0;
  std::unique_ptr<PointHold> hold_;
  std::vector<Moment> moments_;
  std::optional<std::int64_t> lost_ns_;
  double largest_rms_px_ = 0;
};

}  // namespace kiroku::compare
