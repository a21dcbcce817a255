#include <memory>
#include <span>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "viewer/api/api.h"
#include "viewer/api/workplaces.h"
#include "viewer/server/workplace_link.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

struct Workplace {
  std::string name;
  Right right;
  std::shared_ptr<WorkplaceLink> link;
};

/// Why somebody is not led there, or "open". The page says how to get it.
std::string state_of(const Workplace& place, const Request& request, const ViewerContext& context) {
  if (!may(request.session->role(), place.right)) return "no-right";
  if (place.link->is_answered()) return "open";
  return context.home().comparison_program.empty() ? "not-installed" : "not-running";
}

void add_routes_of(Router& router, const Workplace& place, std::span<const WorkplaceRoute> routes) {
  for (const WorkplaceRoute& each : routes) {
    Route route;
    route.method = each.method;
    route.pattern = each.pattern;
    route.right = each.right;
    if (each.is_socket) {
      route.socket = [link = place.link](const Request& request, std::shared_ptr<SocketOutput> output) {
        return link->open(request, std::move(output));
      };
    } else {
      route.handler = [link = place.link](const Request& request) { return link->ask(request); };
    }
    router.add(std::move(route));
  }
}

}  // namespace

void add_workplace_routes(Router& router, ViewerContext& context) {
  const auto link_to = [&context](const char* what, const std::filesystem::path& socket) {
    return std::make_shared<WorkplaceLink>(what, socket, context.closing());
  };
  const ViewerHome& home = context.home();
  const Workplace planning{"planning", Right::kPlan, link_to("planning", home.planning_socket)};
  const Workplace breathing{"breathing", Right::kPlan, link_to("breathing", home.breathing_socket)};
  const Workplace training{"training", Right::kTrain, link_to("training", home.training_socket)};
  add_routes_of(router, planning, kPlanningRoutes);
  add_routes_of(router, breathing, kBreathingRoutes);
  add_routes_of(router, training, kTrainingRoutes);
  Route list;
  list.method = "GET";
  list.pattern = "api/workplaces";
  list.right = Right::kListCases;
  // The page looks by itself whether a program has come.
  list.is_activity = false;
  list.handler = [&context, planning, breathing, training](const Request& request) {
    ordered_json places = ordered_json::array({{{"name", "cases"}, {"state", "open"}}});
    for (const Workplace* place : {&planning, &breathing, &training})
      places.push_back({{"name", place->name}, {"state", state_of(*place, request, context)}});
    return Response::json({{"workplaces", places}});
  };
  router.add(std::move(list));
}

}  // namespace kiroku::viewer
