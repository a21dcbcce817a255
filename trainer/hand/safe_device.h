// Between a force loop and a device that a person holds: poses that make no sense are not believed, and
// forces are limited in size and in how quickly they change, whatever happens on either side.
#pragma once

#include <cstdint>
#include <exception>
#include <vector>

#include "sim/haptics/haptic_device.h"

namespace kiroku::trainer {

struct SafetyLimits {
  double most_force_n = 10;     // of a tool
  double most_slope_n_s = 400;  // how quickly a tool's force may change
  double most_speed_m_s = 3;    // a hand is slower; what is faster is a jump
  double steady_s = 0.3;        // poses must make sense for so long to be believed again
  // Of the wrist, which bears all fingers and turns at most as a hand is turned.
  double most_wrist_n = 20, most_wrist_slope_n_s = 800;
  double most_wrist_nm = 2, most_wrist_slope_nm_s = 80;
};

/// Poses that are not sound, or of a tool or wrist that moved or turned faster than a hand, are a fault: from
/// then on no pose is believed and forces go to zero as quickly as the slope allows, until poses made sense
/// for `steady_s`. Not thread-safe, as every device.
class SafeDevice : public sim::HapticDevice {
 public:
  /// `device` must outlive it; every write() is `period_s` after the one before. kiroku::UsageError for
  /// limits without sense.
  SafeDevice(sim::HapticDevice& device, double period_s, const SafetyLimits& limits = {});

  [[nodiscard]] std::size_t tools() const override { return device_.tools(); }
  bool read(std::span<sim::Pose> poses) override;
  void write(std::span<const sim::Vector3> forces_n) override;
  [[nodiscard]] bool has_wrist() const override { return device_.has_wrist(); }
  [[nodiscard]] sim::Pose wrist() const override { return wrist_; }
  void write_wrist(const sim::WristForce& wrist) override;

  /// After the force loop has ended: writes until all forces are zero, as they may not end at once.
  void come_to_rest();

  [[nodiscard]] bool believes() const { return believes_; }
  struct Faults {
    std::uint64_t unsound = 0;  // poses that are none
    std::uint64_t jumps = 0;
    std::uint64_t unsound_forces = 0;  // that were asked for, not finite: zero was given instead
  };
  [[nodiscard]] const Faults& faults() const { return faults_; }
  /// What was given last.
  [[nodiscard]] const std::vector<sim::Vector3>& given_n() const { return given_n_; }
  [[nodiscard]] const sim::WristForce& given_wrist() const { return given_wrist_; }

 private:
  /// Brings what was given nearer to what is wanted, no further than both limits let it.
  void approach(sim::Vector3& given, sim::Vector3 wanted, double most, double most_slope);

  sim::HapticDevice& device_;
  double period_s_;
  SafetyLimits limits_;
  std::vector<sim::Pose> seen_, read_;
  sim::Pose seen_wrist_, wrist_;
  std::vector<sim::Vector3> given_n_;
  sim::WristForce given_wrist_;
  bool any_seen_ = false, wrist_seen_ = false, believes_ = true;
  double since_seen_s_ = 0, steady_s_ = 0;
  Faults faults_;
};

/// Lets a device come to rest when its scope ends, however that is.
class AtRest {
 public:
  explicit AtRest(SafeDevice& device) : device_(device) {}
  ~AtRest() {
    try {
      device_.come_to_rest();
    } catch (const std::exception&) {
      // The device itself has failed: nothing more can be said to it.
    }
  }
  AtRest(const AtRest&) = delete;
  AtRest& operator=(const AtRest&) = delete;

 private:
  SafeDevice& device_;
};

}  // namespace kiroku::trainer
