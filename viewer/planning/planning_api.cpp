#include "viewer/planning/planning_api.h"

#include <nlohmann/json.hpp>

#include "viewer/http/response.h"
#include "viewer/planning/planning_socket.h"

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

void add_planning_routes(Router& router, PlanningRoom& room, ViewerContext& context) {
  router.add("GET", "api/planning/plans", Right::kPlan,
             [&room](const Request& /*request*/) { return plans(room); });
  Route table;
  table.method = "GET";
  table.pattern = "api/planning/table";
  table.right = Right::kPlan;
  table.body_limit = kLongestPlanningMessage;
  table.socket = [&room, &context](const Request& request, std::shared_ptr<SocketOutput> output) {
    auto enter = [&context, who = request.session->user(), peer = request.peer](const std::string& plan) {
      context.enter_access(ViewerContext::kEveryCase, "opened plan " + plan + " with its volume", who, peer);
    };
    return std::make_unique<PlanningSocket>(room, request.session->person(), std::move(output),
                                            std::move(enter));
  };
  router.add(std::move(table));
}

}  // namespace kiroku::viewer
