// A plan carried out once and kept, for going back and forth in it. Not thread-safe.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "sim/plan/plan_run.h"

namespace kiroku::sim {

/// Stresses and what tools feel are not kept; the rest is some hundred kB a frame.
class PlanFrames {
 public:
  /// Carries the plan out; `progress` is told the time of each frame. kiroku::Error as PlanRun throws it. The
  /// plan must outlive the object.
  explicit PlanFrames(const Plan& plan, const std::function<void(double time_s)>& progress = {});

  struct Kept {
    PlanFrame frame;                      // without stress_pa and tools
    std::shared_ptr<const TetMesh> mesh;  // as of that frame; shared until a cut changes it
  };
  [[nodiscard]] const std::vector<Kept>& all() const { return all_; }
  /// The last frame of the steps up to `step` that is not later than `time_s`; the first where there is none.
  [[nodiscard]] const Kept& at(std::size_t step, double time_s) const;

 private:
  std::vector<Kept> all_;
};

}  // namespace kiroku::sim
