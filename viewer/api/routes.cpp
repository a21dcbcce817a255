#include "viewer/api/api.h"
#include "viewer/api/openapi.h"
#include "viewer/api/report_api.h"

namespace kiroku::viewer {

namespace {

void add_openapi_route(Router& router) {
  router.add("GET", "api/openapi.json", Right::kListCases, [](const Request& /*request*/) {
    return Response::text(std::string(openapi_text()), "application/json");
  });
}

}  // namespace

void add_fleet_routes(Router& router, ViewerContext& context, SignInLink& link) {
  add_openapi_route(router);
  add_session_routes(router, context, link);
  add_stored_case_routes(router, context);
  add_fleet_room_routes(router, context);
  add_case_routes(router, context);
  add_playback_routes(router, context);
  add_verification_routes(router, context);
  add_log_routes(router, context);
  add_user_routes(router, context);
}

void add_routes(Router& router, ViewerContext& context, SignInLink& link) {
  add_openapi_route(router);
  add_session_routes(router, context, link);
  add_case_list_routes(router, context);
  add_case_routes(router, context);
  add_playback_routes(router, context);
  add_comparison_routes(router, context);
  add_matching_routes(router, context);
  add_verification_routes(router, context);
  add_report_routes(router, context);
  add_consent_routes(router, context);
  add_export_routes(router, context);
  add_room_routes(router, context);
  add_live_routes(router, context);
  add_pointing_routes(router, context);
  add_invitation_routes(router, context);
  add_workplace_routes(router, context);
  add_log_routes(router, context);
  add_user_routes(router, context);
}

}  // namespace kiroku::viewer
