// A hand as a model: what it wants to do, and how it yields to what it feels.
#pragma once

#include <functional>
#include <vector>

#include "sim/haptics/haptic_device.h"

namespace kiroku::sim {

/// Every tool hangs on a spring and a damper between where the hand wants it and where it is (the impedance
/// of a hand: Hogan, "Impedance control", 1985). Same paths, same forces, same bits. Not thread-safe.
class SimulatedHand : public HapticDevice {
 public:
  /// Where the hand wants a tool, and how it holds it, `time_s` after the beginning.
  using Path = std::function<Pose(double time_s)>;
  struct Impedance {
    double mass_kg = 0.05, stiffness_n_m = 300, damping_n_s_m = 8;
  };

  /// A path a tool; every write() is `period_s` later. kiroku::UsageError for numbers that are not greater
  /// than zero, and a period too long for the spring.
  SimulatedHand(std::vector<Path> paths, double period_s, const Impedance& impedance);
  SimulatedHand(std::vector<Path> paths, double period_s)
      : SimulatedHand(std::move(paths), period_s, Impedance()) {}

  [[nodiscard]] std::size_t tools() const override { return paths_.size(); }
  bool read(std::span<Pose> poses) override;
  void write(std::span<const Vector3> forces_n) override;

 private:
  std::vector<Path> paths_;
  double period_s_;
  Impedance impedance_;
  std::uint64_t steps_ = 0;
  std::vector<Pose> poses_;
  std::vector<Vector3> velocities_m_s_;
};

}  // namespace kiroku::sim
