// How fingers moved, as a file: recorded from any device, played as a device, shown as a ghost.
//
//   kiroku-hand-motion 1
//   fingers 2
//   0 -0.03 -0.05 -0.04 1 0 0 0 0.03 -0.05 -0.04 1 0 0 0
//   0.01 ...
//
// A line a moment: seconds, strictly ascending, then for each finger x, y, z in metres and w, x, y, z of its
// unit quaternion, in the mesh's frame. Lines that begin with # say nothing. Version 2 is of devices that
// have a wrist: its seven numbers stand behind those of the fingers, in the moments that had one.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/contact/pose.h"
#include "sim/haptics/haptic_device.h"
#include "sim/haptics/rate_scheduler.h"

namespace kiroku::trainer {

/// Plain data: (moments) times and (moments x fingers) poses; (moments) wrists, or none where no moment has
/// one.
struct HandMotion {
  std::size_t fingers = 0;
  std::vector<double> times_s;
  std::vector<std::vector<sim::Pose>> poses;
  std::vector<std::optional<sim::Pose>> wrists = {};

  /// Between two moments along the straight line and turning evenly; before the first and after the last as
  /// these. At least one moment.
  [[nodiscard]] std::vector<sim::Pose> at(double time_s) const;
  /// Likewise; between a moment with a wrist and one without, as the earlier one.
  [[nodiscard]] std::optional<sim::Pose> wrist_at(double time_s) const;
  [[nodiscard]] double duration_s() const { return times_s.empty() ? 0 : times_s.back(); }
};

/// kiroku::Error in one sentence with `file` and the line, for what is no hand motion.
HandMotion parse_hand_motion(std::string_view text, const std::string& file);
/// What parse_hand_motion() reads back to the bit.
std::string text_of(const HandMotion& motion);

/// Plays a motion, with its wrist where it has one; every write() is `period_s` later. Not thread-safe.
class MotionPlayer : public sim::HapticDevice {
 public:
  /// kiroku::UsageError for a motion without moments.
  MotionPlayer(HandMotion motion, double period_s);
  [[nodiscard]] std::size_t tools() const override { return motion_.fingers; }
  bool read(std::span<sim::Pose> poses) override;
  void write(std::span<const sim::Vector3> forces_n) override;
  [[nodiscard]] bool has_wrist() const override { return wrist_.has_value(); }
  [[nodiscard]] sim::Pose wrist() const override { return *wrist_; }

 private:
  HandMotion motion_;
  double period_s_;
  std::uint64_t steps_ = 0;
  std::optional<sim::Pose> wrist_;
};

/// Passes on what a device does and keeps the motion of its fingers and wrist, a hundred moments a second at
/// most. Not thread-safe.
class MotionRecorder : public sim::HapticDevice {
 public:
  /// `device` must outlive it; in its own time, every write() is `period_s` later. Room for `longest_s` is
  /// taken at once, so that a force loop is not held up; what comes later is not kept.
  MotionRecorder(sim::HapticDevice& device, double period_s, double longest_s);
  /// In the time of `clock`, which must outlive it, from the first read() on: a force loop that is late skips
  /// steps, so that steps do not tell its time.
  MotionRecorder(sim::HapticDevice& device, double period_s, double longest_s, sim::SchedulerClock& clock);
  [[nodiscard]] std::size_t tools() const override { return device_.tools(); }
  bool read(std::span<sim::Pose> poses) override;
  void write(std::span<const sim::Vector3> forces_n) override;
  [[nodiscard]] bool has_wrist() const override { return device_.has_wrist(); }
  [[nodiscard]] sim::Pose wrist() const override { return device_.wrist(); }
  void write_wrist(const sim::WristForce& wrist) override { device_.write_wrist(wrist); }
  /// What was kept so far.
  [[nodiscard]] HandMotion motion() const;

 private:
  static constexpr double kLeastSeconds = 0.01;
  [[nodiscard]] double now_s();
  sim::HapticDevice& device_;
  double period_s_;
  sim::SchedulerClock* clock_ = nullptr;  // none: in its own time
  std::optional<std::chrono::nanoseconds> begun_;
  std::uint64_t steps_ = 0;
  std::size_t kept_ = 0;
  HandMotion motion_;
};

}  // namespace kiroku::trainer
