// What all who plan at a server share: the plans, and how many may plan at once. Thread-safe.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "viewer/people/turns.h"
#include "viewer/planning/plan_folder.h"
#include "viewer/planning/planning_table.h"

namespace kiroku::viewer {

struct PlanningOptions {
  std::filesystem::path plans;
  TableOptions table;
  std::size_t at_once = 1;  // each needs about two cores while something moves
  Clock::Duration patience = kPatienceForPlaces;
  /// Hears in one sentence of what failed inside; called from several threads.
  std::function<void(const std::string& sentence)> tell;
};

class PlanningRoom {
 public:
  /// kiroku::UsageError where there is no folder of plans.
  explicit PlanningRoom(PlanningOptions options);

  [[nodiscard]] const PlanningOptions& options() const { return options_; }
  [[nodiscard]] const PlanFolder& folder() const { return folder_; }

  /// A place for `person` (Session::person()); the room must outlive it. Refusal 503 where all are taken;
  /// where their own are, after PlanningOptions::patience, which it blocks. Of several places one is always
  /// left for others.
  std::unique_ptr<Turns::Turn> enter(const std::string& person);

 private:
  PlanningOptions options_;
  PlanFolder folder_;
  Turns places_;
};

}  // namespace kiroku::viewer
