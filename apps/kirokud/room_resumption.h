// Cases that a crash cut off, and the rooms that carry them on.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "apps/configuration/configuration.h"
#include "apps/kiroku/home.h"
#include "recorder/daemon/daemon.h"
#include "recorder/daemon/resumption.h"

namespace kiroku::apps {

/// Rooms whose cases are carried on after a crash, and why one is not.
class RoomResumption {
 public:
  RoomResumption(const Home& home, const Configuration& configuration);

  recorder::ResumptionPlanner& planner() { return planner_; }
  /// Gives the plan what its room needs to carry on.
  void apply(recorder::RoomPlan& plan);

 private:
  recorder::ResumptionPlanner::Context context(const Home& home);
  std::vector<recorder::ResumeRule> rules(const Home& home, const Configuration& configuration);

  std::map<std::string, std::shared_ptr<recorder::RunningNote>> notes_;
  std::map<std::string, std::string> why_not_;
  recorder::ResumptionPlanner planner_;
};

}  // namespace kiroku::apps
