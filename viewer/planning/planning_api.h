// The planner's part of the API (docs/reference/viewer.md, "Planning").
#pragma once

#include "viewer/api/viewer_context.h"
#include "viewer/http/router.h"
#include "viewer/planning/planning_room.h"

namespace kiroku::viewer {

/// `room` and `context`, whose appliance log gets an entry for each plan that is opened, must outlive the
/// router.
void add_planning_routes(Router& router, PlanningRoom& room, ViewerContext& context);

}  // namespace kiroku::viewer
