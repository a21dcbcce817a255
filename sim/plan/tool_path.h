// Where a tool goes: poses at times, and what is between them. Immutable, thread-safe.
#pragma once

#include <vector>

#include "sim/contact/pose.h"

namespace kiroku::sim {

struct KeyFrame {
  double at_s = 0;  // since the path began
  Pose pose;
};

/// Between two key frames the position moves along the straight line and the orientation turns about one
/// axis, the shorter way, both evenly.
class ToolPath {
 public:
  /// At least one frame, the first at 0, times ascending; poses sound().
  explicit ToolPath(std::vector<KeyFrame> frames);

  [[nodiscard]] Pose at(double time_s) const;  // the first or the last beyond its ends
  [[nodiscard]] double duration_s() const { return frames_.back().at_s; }
  [[nodiscard]] const std::vector<KeyFrame>& frames() const { return frames_; }

 private:
  std::vector<KeyFrame> frames_;
};

}  // namespace kiroku::sim
