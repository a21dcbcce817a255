#include "sim/plan/tool_path.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace kiroku::sim {

ToolPath::ToolPath(std::vector<KeyFrame> frames) : frames_(std::move(frames)) {
  assert(!frames_.empty() && frames_.front().at_s == 0);
  assert(std::ranges::is_sorted(frames_, std::ranges::less(), &KeyFrame::at_s));
}

Pose ToolPath::at(double time_s) const {
  const auto after = std::ranges::upper_bound(frames_, time_s, std::ranges::less(), &KeyFrame::at_s);
  if (after == frames_.begin()) return frames_.front().pose;
  if (after == frames_.end()) return frames_.back().pose;
  const KeyFrame &from = *(after - 1), &to = *after;
  if (time_s == from.at_s) return from.pose;  // to the bit
  const double part = (time_s - from.at_s) / (to.at_s - from.at_s);
  return {from.pose.position_m + part * (to.pose.position_m - from.pose.position_m),
          from.pose.orientation.slerp(part, to.pose.orientation).normalized()};
}

}  // namespace kiroku::sim
