#include "sim/plan/plan_frames.h"

#include <algorithm>

namespace kiroku::sim {

PlanFrames::PlanFrames(const Plan& plan, const std::function<void(double time_s)>& progress) {
  PlanRun run(plan);
  std::shared_ptr<const TetMesh> mesh;
  while (run.next()) {
    if (!mesh || mesh->tetrahedra.size() != run.mesh().tetrahedra.size() || mesh->nodes != run.mesh().nodes)
      mesh = std::make_shared<const TetMesh>(run.mesh());
    Kept& kept = all_.emplace_back(Kept{run.frame(), mesh});
    kept.frame.stress_pa = {};
    kept.frame.tools = {};
    if (progress) progress(kept.frame.time_s);
  }
}

const PlanFrames::Kept& PlanFrames::at(std::size_t step, double time_s) const {
  // Times are sums of steps; those of one moment differ in their last digits.
  constexpr double kSameMomentS = 1e-9;
  const auto after = std::ranges::partition_point(all_, [&](const Kept& kept) {
    return kept.frame.step < step || (kept.frame.step == step && kept.frame.time_s <= time_s + kSameMomentS);
  });
  return after == all_.begin() ? all_.front() : *std::prev(after);
}

}  // namespace kiroku::sim
