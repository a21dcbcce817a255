// Forces at 1 kHz or more, in a thread of their own: poses in, forces out, and how well it kept time.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <exception>
#include <mutex>
#include <optional>
#include <span>
#include <thread>
#include <vector>

#include "sim/haptics/haptic_device.h"
#include "sim/haptics/latency_histogram.h"

namespace kiroku::sim {

/// What tools feel. Called by the loop's thread alone.
class ForceSource {
 public:
  virtual ~ForceSource() = default;
  /// One pose and one force a tool; neither waits nor takes longer than the loop's period, as far as it can.
  /// `period_s` has passed since the last call. What it throws ends the loop.
  virtual void forces(std::span<const Pose> poses, double period_s, std::span<Vector3> forces_n) = 0;
  /// Where the wrist is at the next forces(); nothing where the device has none. Called before it.
  virtual void wrist_at(const std::optional<Pose>& /*wrist*/) {}
  /// What a wrist at `wrist_m` bears of the last forces(): their sum before anything is left out of what the
  /// tools play, and its torque. Called after it, for devices that have a wrist. Nothing where no hand holds
  /// the tools.
  virtual WristForce wrist_force(const Vector3& /*wrist_m*/) { return {}; }
};

struct ForceLoopOptions {
  double rate_hz = 1000;
  /// SCHED_FIFO, 1 to 99, where the system allows it (CAP_SYS_NICE or RLIMIT_RTPRIO); 0 asks for none.
  int real_time_priority = 80;
  /// Larger ones are scaled down to it: the hand is worth more than a wrong pose.
  double most_force_n = 40;
  /// Without a new pose for so long, nothing is felt until one comes.
  std::chrono::nanoseconds pose_timeout = std::chrono::milliseconds(100);
  /// Keeps what the process has mapped by then in memory once it was touched, for as long as it runs, where
  /// the system allows it (CAP_IPC_LOCK or RLIMIT_MEMLOCK).
  bool lock_memory = true;
  /// Of a wrist, which bears more than a finger.
  double most_wrist_n = 100, most_wrist_nm = 10;
};

struct ForceLoopStatistics {
  std::uint64_t steps = 0;
  std::uint64_t on_time = 0;         // whose forces were out before the next step was due
  std::uint64_t skipped = 0;         // never begun, as the one before took too long
  std::uint64_t late_woken = 0;      // late though they took less than a period: the system began them late
  std::uint64_t without_pose = 0;    // for too long: forces were zero
  std::uint64_t limited_forces = 0;  // of a tool or the wrist, that were larger than allowed
  bool real_time = false;            // whether the system gave the priority
  bool memory_locked = false;        // and kept the memory
  /// How much later than due steps began.
  std::chrono::nanoseconds jitter_50{0}, jitter_99{0}, jitter_999{0}, jitter_longest{0};
  /// From reading poses to forces written.
  std::chrono::nanoseconds step_50{0}, step_99{0}, step_999{0}, step_longest{0};

  /// Of all steps that were due; 1 for none.
  [[nodiscard]] double on_time_share() const {
    const std::uint64_t due = steps + skipped;
    return due == 0 ? 1 : static_cast<double>(on_time) / static_cast<double>(due);
  }
};

/// The loop runs from construction to stop(). Device and source must outlive it and belong to its thread
/// until then. The other functions are thread-safe.
class ForceLoop {
 public:
  /// kiroku::UsageError for a rate, a priority or a force without sense.
  ForceLoop(HapticDevice& device, ForceSource& source, const ForceLoopOptions& options = {});
  /// Stops; a failure that nobody asked for is lost.
  ~ForceLoop();
  ForceLoop(const ForceLoop&) = delete;
  ForceLoop& operator=(const ForceLoop&) = delete;

  /// Ends the loop after its step; the last forces written are zero. Throws what device or source threw.
  void stop();
  [[nodiscard]] bool running() const { return running_; }
  /// Throws what device or source threw: then the loop has ended and the tools feel nothing.
  [[nodiscard]] ForceLoopStatistics statistics() const;

 private:
  void run();
  void prepare_thread();
  void step(double period_s);
  void limit(Vector3& of, double most);
  void rethrow_failure() const;

  HapticDevice& device_;
  ForceSource& source_;
  ForceLoopOptions options_;
  std::vector<Pose> poses_;
  std::vector<Vector3> forces_n_;
  std::chrono::nanoseconds pose_at_{0};
  bool has_pose_ = false;

  std::atomic<bool> ending_ = false, running_ = true, real_time_ = false, memory_locked_ = false;
  std::atomic<std::uint64_t> steps_ = 0, on_time_ = 0, skipped_ = 0, late_woken_ = 0, without_pose_ = 0,
                             limited_ = 0;
  LatencyHistogram jitter_, step_;
  mutable std::mutex failure_mutex_;
  std::exception_ptr failure_;
  std::thread thread_;  // last, as it uses all above
};

}  // namespace kiroku::sim
