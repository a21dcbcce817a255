// Instruments in trocars whose tips are led by pointers on the trainee's picture.
//
// A pointer says where the end of a tip is to be (PointerHand), and the handle goes where it must for that.
// So who points sees the tip go with the pointer, while the shaft still pivots in the wall. Near its trocar a
// tip hardly moves for a handle that moves far: there the handle goes no faster than a hand, and the tip
// comes later.
#pragma once

#include <vector>

#include "sim/haptics/haptic_device.h"
#include "trainer/hand/trocar.h"

namespace kiroku::trainer {

/// A device whose tools are the handles. Forces are passed on as they come. Not thread-safe, as every device.
class PointerInstruments : public sim::HapticDevice {
 public:
  /// Below what SafeDevice takes for a jump.
  static constexpr double kMostHandleSpeedMetres = 2;

  /// `ends` must outlive it; every write() is `period_s` later. As many trocars as it has tools, else
  /// kiroku::UsageError.
  PointerInstruments(sim::HapticDevice& ends, std::vector<Trocar> trocars, double period_s);
  [[nodiscard]] std::size_t tools() const override { return ends_.tools(); }
  bool read(std::span<sim::Pose> poses) override;
  void write(std::span<const sim::Vector3> forces_n) override { ends_.write(forces_n); }

 private:
  [[nodiscard]] sim::Pose on_the_way(const Trocar& trocar, const sim::Pose& from, const sim::Pose& to) const;

  sim::HapticDevice& ends_;
  std::vector<Trocar> trocars_;
  double most_step_m_;
  std::vector<sim::Pose> last_;  // empty before the first read()
};

}  // namespace kiroku::trainer
