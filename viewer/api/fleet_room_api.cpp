// All rooms of all appliances that report, and which appliances may.
#include <nlohmann/json.hpp>

#include "viewer/api/api.h"
#include "viewer/api/fleet_rooms.h"
#include "viewer/people/json_fields.h"

namespace kiroku::viewer {
namespace {

constexpr int kCreated = 201, kNotFound = 404;

Response enrol(ViewerContext& context, FleetRooms& rooms, const Request& request) {
  nlohmann::json body = request.json();
  const std::string code = take_text(body, "code");
  const FleetRooms::Asked asked = rooms.asked(code);
  // Nothing changes that the log does not say first.
  context.enter_access(request, ViewerContext::kEveryCase,
                       "enrols appliance " + asked.appliance + " by request " + asked.fingerprint);
  rooms.enrol(code, request.session->user());
  return Response::json({{"appliance", asked.appliance}, {"fingerprint", asked.fingerprint}}, kCreated);
}

Response revoke(ViewerContext& context, FleetRooms& rooms, const Request& request) {
  const std::string& name = request.parameter("appliance");
  context.enter_access(request, ViewerContext::kEveryCase, "revokes appliance " + name);
  if (!rooms.revoke(name)) throw Refusal(kNotFound, "no appliance " + name + " is enrolled");
  return Response::nothing();
}

}  // namespace

void add_fleet_room_routes(Router& router, ViewerContext& context) {
  const std::shared_ptr<FleetRooms> rooms = context.home().fleet_rooms;
  router.add({.method = "GET",
              .pattern = "api/fleet/rooms",
              .right = Right::kSeeLive,
              .handler = [rooms](const Request& /*request*/) { return Response::json(rooms->rooms()); },
              .is_activity = false,
              .is_quick = true});
  router.add("POST", "api/fleet/enrolments", Right::kManageUsers,
             [&context, rooms](const Request& request) { return enrol(context, *rooms, request); });
  router.add("POST", "api/fleet/appliances/{appliance:name}/revocation", Right::kManageUsers,
             [&context, rooms](const Request& request) { return revoke(context, *rooms, request); });
}

}  // namespace kiroku::viewer
