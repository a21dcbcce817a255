// What all who plan at a server share: the plans, and how many may plan at once. Thread-safe.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>

#include "viewer/planning/plan_folder.h"
#include "viewer/planning/planning_table.h"

namespace kiroku::viewer {

struct PlanningOptions {
  std::filesystem::path plans;
  TableOptions table;
  std::size_t at_once = 1;  // each needs about two cores while something moves
  /// Hears in one sentence of what failed inside; called from several threads.
  std::function<void(const std::string& sentence)> tell;
};

class PlanningRoom {
 public:
  /// kiroku::UsageError where there is no folder of plans.
  explicit PlanningRoom(PlanningOptions options);

  [[nodiscard]] const PlanningOptions& options() const { return options_; }
  [[nodiscard]] const PlanFolder& folder() const { return folder_; }

  /// Somebody's who plans; the room must outlive it.
  class Place {
   public:
    explicit Place(PlanningRoom& room) : room_(room) {}
    ~Place() { --room_.taken_; }
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;

   private:
    PlanningRoom& room_;
  };
  /// Refusal 503 where all places are taken.
  std::unique_ptr<Place> enter();

 private:
  PlanningOptions options_;
  PlanFolder folder_;
  std::atomic<std::size_t> taken_ = 0;
};

}  // namespace kiroku::viewer
