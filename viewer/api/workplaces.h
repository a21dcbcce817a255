// Where one can work by the viewer's address beside its cases: what programs behind it answer, and who may.
// Constants; thread-safe.
#pragma once

#include <array>
#include <string_view>

#include "viewer/http/role.h"

namespace kiroku::viewer {

/// An address that a program behind the viewer answers. The same right is asked for there again.
struct WorkplaceRoute {
  std::string_view method, pattern;  // as of Route
  Right right = Right::kNone;
  bool is_socket = false;
};

/// Of `kiroku plan serve` (viewer/planning/planning_api.h), `kiroku respire serve`
/// (viewer/breathing/breathing_api.h) and `kiroku train serve` (viewer/training/training_api.h); a test
/// compares them with what these have.
inline constexpr std::array<WorkplaceRoute, 2> kPlanningRoutes{{
    {"GET", "api/planning/plans", Right::kPlan},
    {"GET", "api/planning/table", Right::kPlan, true},
}};
inline constexpr std::array<WorkplaceRoute, 1> kBreathingRoutes{{
    {"GET", "api/breathing/table", Right::kPlan, true},
}};
inline constexpr std::array<WorkplaceRoute, 8> kTrainingRoutes{{
    {"GET", "api/training", Right::kTrain},
    {"POST", "api/training/trainees", Right::kTrain},
    {"GET", "api/training/trainees/{trainee:text}/results", Right::kTrain},
    {"POST", "api/training/attempts/{attempt:number}/case", Right::kTrain},
    {"POST", "api/training/attempts/{attempt:number}/questionnaire", Right::kTrain},
    {"POST", "api/training/attempts/{attempt:number}/checklist", Right::kTrain},
    {"GET", "api/training/attempts/{attempt:number}/certificate.pdf", Right::kTrain},
    {"GET", "api/training/attempt", Right::kTrain, true},
}};

}  // namespace kiroku::viewer
