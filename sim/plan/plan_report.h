// What a run of a plan leaves behind, as texts. Lengths are in the plan's unit, all else in SI units. Numbers
// are written so that they read back to the bit.
#pragma once

#include <optional>
#include <string>

#include "sim/plan/plan_run.h"

namespace kiroku::sim {

/// The frame for ParaView: point data displacement, cell data stress (XX, YY, ZZ, XY, YZ, XZ; Pa),
/// von_mises_stress (Pa) and region, on the undeformed mesh.
std::string frame_vtu(const Plan& plan, const PlanRun& run);

/// Tables that grow by each frame; RFC 4180, a header line first. Not thread-safe.
class PlanTables {
 public:
  explicit PlanTables(const Plan& plan);
  void add(const PlanRun& run);

  /// A line a tool at the organ: its force and torque, what of the force is along and across the surface, and
  /// how many nodes it holds or presses.
  [[nodiscard]] const std::string& forces() const { return forces_; }
  /// A line a frame: the largest displacement and von Mises stress, where that is, and its mean over the
  /// organ's volume.
  [[nodiscard]] const std::string& stress() const { return stress_; }
  /// A line a tool at the organ: where it is, and its orientation as a quaternion.
  [[nodiscard]] const std::string& tools() const { return tools_; }

 private:
  const Plan& plan_;
  std::string forces_, stress_, tools_;
};

/// All figures of all steps begun, as JSON; where the run could not go on, `stopped` says why.
std::string steps_json(const Plan& plan, const PlanRun& run, const std::optional<std::string>& stopped = {});

}  // namespace kiroku::sim
