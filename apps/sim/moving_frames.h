// What 'kiroku sim respire' left, as a motion: where each node is at any moment. Immutable, thread-safe.
#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::apps {

class MovingFrames {
 public:
  /// The displacement of each node (|V|), m, as a frame's file says.
  using Read = std::function<std::vector<sim::Vector3>(const std::filesystem::path& vtu)>;

  /// `folder` holds a list of frames (.pvd) and the frames. `repeats`: they are one breath, which follows
  /// itself; the time from the last frame to the first is that between the last two. kiroku::UsageError where
  /// there is no list, or several; what `read` throws; kiroku::Error for a breath of one frame that repeats.
  MovingFrames(const std::filesystem::path& folder, bool repeats, const Read& read);

  /// Evenly between two frames. kiroku::Error for a time that no frame is known for.
  [[nodiscard]] std::vector<sim::Vector3> displacement_m(double time_s) const;
  /// From the first frame to the last, or of the breath that repeats.
  [[nodiscard]] double duration_s() const;
  [[nodiscard]] std::size_t count() const { return times_s_.size(); }

 private:
  bool repeats_;
  std::vector<double> times_s_;  // of a breath that repeats with its first frame once more at the end
  std::vector<std::vector<sim::Vector3>> displacements_m_;
};

}  // namespace kiroku::apps
