// Plan time and case time of one another: straight lines between what was matched. Immutable, thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "viewer/compare/step_matching.h"

namespace kiroku::compare {

/// One moment on both clocks.
struct Knot {
  double plan_s = 0;
  std::int64_t case_ns = 0;
};

/// A step of the plan in the recording. At least two knots; plan time never goes back from one to the next
/// and stands where the step was interrupted, case time always goes on.
struct MapPiece {
  std::size_t step = 0;
  std::vector<Knot> knots;
};

/// Where the plan is at a moment of the recording.
struct PlanMoment {
  std::size_t step = 0;
  double plan_s = 0;
  bool stands = false;  // between two steps, in a pause, before the first or after the last
};

class TimeMap {
 public:
  /// A piece for each step that was found and lasted. Between two knots both clocks run evenly; between two
  /// pieces the plan stands at the end of the earlier one. `points` are more moments that a person matched:
  /// each within one step, on both clocks. kiroku::UsageError in a sentence where one is not, or would turn
  /// time back; kiroku::Error where no step lasted.
  TimeMap(std::span<const PlannedStep> steps, const StepMatching& matching,
          std::span<const Knot> points = {});

  /// In order of case time.
  [[nodiscard]] const std::vector<MapPiece>& pieces() const { return pieces_; }
  /// Whether plan time never goes back: the steps were done in the planned order.
  [[nodiscard]] bool monotone() const { return monotone_; }

  [[nodiscard]] PlanMoment plan_at(std::int64_t case_ns) const;
  /// The same while a step is done, pauses within it too; nothing before, between and after steps.
  [[nodiscard]] std::optional<PlanMoment> during(std::int64_t case_ns) const;
  /// The inverse within a step; the first of the moments at which the plan stands there. Nothing where the
  /// step was not found or is elsewhere in the plan.
  [[nodiscard]] std::optional<std::int64_t> case_at(std::size_t step, double plan_s) const;

 private:
  std::vector<MapPiece> pieces_;
  bool monotone_ = true;
};

}  // namespace kiroku::compare
