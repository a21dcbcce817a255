// What a hand holds: gives where its tools are, takes what they and the wrist feel.
#pragma once

#include <span>

#include "sim/contact/pose.h"
#include "sim/haptics/wrist_force.h"

namespace kiroku::sim {

/// Used by the thread of a ForceLoop alone; no function may wait.
class HapticDevice {
 public:
  virtual ~HapticDevice() = default;

  [[nodiscard]] virtual std::size_t tools() const = 0;
  /// The newest poses, one a tool, sound(); false, and `poses` as they were, if none came since the last
  /// call.
  virtual bool read(std::span<Pose> poses) = 0;
  /// On the tools, N, in the mesh's frame.
  virtual void write(std::span<const Vector3> forces_n) = 0;

  /// Whether it gives where the hand's wrist is and plays what the wrist bears. May change with read().
  [[nodiscard]] virtual bool has_wrist() const { return false; }
  /// The wrist's pose that came with the newest poses; sound(). Only where has_wrist().
  [[nodiscard]] virtual Pose wrist() const { return {}; }
  /// On the wrist, played with the forces of the write() that follows. Only where has_wrist().
  virtual void write_wrist(const WristForce& /*wrist*/) {}
};

}  // namespace kiroku::sim
