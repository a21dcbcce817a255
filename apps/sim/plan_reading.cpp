#include "apps/sim/plan_reading.h"

#include <utility>

#include <nlohmann/json.hpp>

#include "apps/common/command_line.h"
#include "apps/common/json_output.h"
#include "apps/common/step_line.h"
#include "base/error.h"
#include "sim/meshing/mesh_recipe.h"
#include "sim/plan/plan_files.h"

namespace kiroku::apps {

std::optional<sim::Plan> read_plan_and_tell(const std::string& file, bool json) {
  if (sim::kind_of_plan(file) == sim::PlanKind::kBreathing) {
    throw UsageError(
        file +
        " is a breathing lung, which has no steps to carry out: 'kiroku sim respire' computes it, 'kiroku "
        "compare' lays it beside a case's fluoroscopy, and 'kiroku respire serve --case' shows both on a "
        "page");
  }
  sim::PlanReading reading = [&] {
    StepLine line;
    return sim::read_plan(file, sim::recipe_mesh_maker([&](const std::string& step) { line.show(step); }));
  }();
  if (json && !reading.plan) print_json({{"plan", file}, {"errors", reading.errors}});
  if (!json) {
    for (const std::string& error : reading.errors) print_error("kiroku", error);
    if (reading.plan) {
      for (const std::string& warning : reading.plan->body.warnings)
        print_error("kiroku", "warning: " + warning);
    }
  }
  return std::move(reading.plan);
}

double duration_s(const sim::Plan& plan) { return sim::begins_s(plan, plan.steps.size()); }

}  // namespace kiroku::apps
