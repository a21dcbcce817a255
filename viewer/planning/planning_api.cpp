#include "viewer/planning/planning_api.h"

#include <nlohmann/json.hpp>

#include "viewer/planning/planning_socket.h"
#include "viewer/server/response.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

Response plans(const PlanningRoom& room) {
  ordered_json all = ordered_json::array();
  for (const PlanFolder::Listed& plan : room.folder().plans()) {
    all.push_back(
        {{"plan", plan.file}, {"name", plan.name}, {"steps", plan.steps}, {"has_volume", plan.has_volume}});
  }
  return Response::json({{"plans", all}});
}

}  // namespace

void add_planning_routes(Router& router, PlanningRoom& room) {
  router.add("GET", "api/planning/plans", Right::kPlan,
             [&room](const Request& /*request*/) { return plans(room); });
  Route table;
  table.method = "GET";
  table.pattern = "api/planning/table";
  table.right = Right::kPlan;
  table.body_limit = kLongestPlanningMessage;
  table.socket = [&room](const Request& /*request*/, std::shared_ptr<SocketOutput> output) {
    return std::make_unique<PlanningSocket>(room, std::move(output));
  };
  router.add(std::move(table));
}

}  // namespace kiroku::viewer
