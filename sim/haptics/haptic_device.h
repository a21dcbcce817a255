// What a hand holds: gives where its tools are, takes what they feel.
#pragma once

#include <span>

#include "sim/contact/pose.h"

namespace kiroku::sim {

/// Used by the thread of a ForceLoop alone; neither function may wait.
class HapticDevice {
 public:
  virtual ~HapticDevice() = default;

  [[nodiscard]] virtual std::size_t tools() const = 0;
  /// The newest poses, one a tool, sound(); false, and `poses` as they were, if none came since the last
  /// call.
  virtual bool read(std::span<Pose> poses) = 0;
  /// On the tools, N, in the mesh's frame.
  virtual void write(std::span<const Vector3> forces_n) = 0;
};

}  // namespace kiroku::sim
