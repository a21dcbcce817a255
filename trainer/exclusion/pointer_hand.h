// A hand that is moved by pointers on the trainee's picture: a mouse, keys, several touch points.
//
// A fingertip lies on the straight line from the eye through its pointer. Where the pointer comes down on the
// organ, the fingertip touches the organ there; beside it, it goes as deep as the space below the border. It
// keeps that depth, and what it is pushed by, until the pointer goes up; then it comes back towards the eye
// and lies down at the lower border of the picture.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "sim/haptics/haptic_device.h"
#include "sim/haptics/latency_histogram.h"
#include "sim/mesh/mesh_topology.h"
#include "sim/render/camera.h"
#include "trainer/exclusion/hand_forces.h"

namespace kiroku::trainer {

struct Pointer {
  std::size_t finger = 0;  // from 1; 0: all fingers of the hand, side by side
  double x = 0, y = 0;     // in the picture, from 0 at its left upper corner to 1
  double push_m = 0;       // deeper than where it came down, less where negative
};

/// All pointers that are down at a moment; what is not in it is up.
struct PointerInput {
  std::uint64_t number = 0;  // above those before
  std::vector<Pointer> pointers;
};

/// read() and write() are for the force loop's thread and never wait; the others are thread-safe.
class PointerHand : public sim::HapticDevice {
 public:
  using Clock = std::chrono::steady_clock;

  /// `body` must outlive it. Every write() is `period_s` later. kiroku::UsageError for other than 1 to
  /// kMostExclusionFingers.
  PointerHand(const ExclusionBody& body, const sim::Camera& camera, std::size_t fingers, double period_s);

  [[nodiscard]] std::size_t tools() const override { return fingers_.size(); }
  bool read(std::span<sim::Pose> poses) override;
  void write(std::span<const sim::Vector3> forces_n) override;

  /// kiroku::UsageError, and nothing changes, for a number that is not above the last, a finger that there is
  /// not or that stands twice, numbers that are not finite or far outside the picture.
  void point(const PointerInput& input, Clock::time_point arrived = Clock::now());
  /// How the organ lies from now on for pointers that come down; (3 |V|).
  void see(std::span<const double> displacement_m);

  /// The newest input whose forces were given before `time`; 0 for none.
  [[nodiscard]] std::uint64_t felt_by(Clock::time_point time) const;
  /// From point() until the forces of a pose on the way there were given.
  [[nodiscard]] const sim::LatencyHistogram& input_to_force() const { return input_to_force_; }

  /// A fingertip goes where its pointer is as a first-order lag of this time does, no faster than the speed:
  /// pointers come some 60 times a second, in steps.
  static constexpr double kLagSeconds = 0.012, kMostSpeedMetres = 0.6;
  static constexpr double kMostPushMetres = 0.08;

 private:
  /// A line from the eye by its slopes to the right and up, and a depth along the middle of the view, m.
  struct Aim {
    bool down = false;
    Eigen::Vector2d slope = Eigen::Vector2d::Zero();
    double depth_m = 0;
  };
  struct Finger {
    sim::Vector3 view_m = sim::Vector3::Zero();  // to the right, up, depth
    bool follows = false;  // else on its way to or from the depth where nothing can be touched
  };
  struct Wanted {
    std::array<Aim, kMostExclusionFingers> aims;
    std::uint64_t number = 0;
    Clock::time_point arrived;
  };

  [[nodiscard]] sim::Vector3 in_view(const sim::Vector3& place_m) const;
  [[nodiscard]] sim::Vector3 lies_down_m(std::size_t finger) const;
  /// Where a fingertip on that line touches the organ, or how deep it goes beside it.
  [[nodiscard]] double depth_at(const Eigen::Vector2d& slope) const;
  [[nodiscard]] sim::Vector3 goal_of(std::size_t finger);

  const ExclusionBody& body_;
  sim::Camera camera_;
  double period_s_;
  Eigen::Quaterniond held_;  // each finger
  std::vector<sim::Face> surface_;
  double free_m_ = 0;          // depth; nearer to the eye nothing can be touched
  double under_border_m_ = 0;  // depth

  // The force loop's.
  std::vector<Finger> fingers_;
  Wanted seen_;
  std::uint64_t felt_ = 0, told_ = 0;
  Clock::time_point felt_at_;
  sim::LatencyHistogram input_to_force_;

  mutable std::mutex mutex_;  // the force loop only tries it
  Wanted wanted_;
  struct Felt {
    std::uint64_t number = 0;
    Clock::time_point at;
  };
  std::array<Felt, 64> felt_ring_{};
  std::size_t felt_next_ = 0;

  std::mutex input_mutex_;                  // point() against see()
  std::vector<sim::Vector3> nodes_view_m_;  // (|V|), to the right, up, depth
  /// Of pointers that are down, by their finger, 0 the whole hand: the depth at which they came down.
  std::array<std::optional<double>, kMostExclusionFingers + 1> came_down_m_;
};

}  // namespace kiroku::trainer
