// The planner's part of the API (docs/reference/viewer.md, "Planning").
#pragma once

#include "viewer/planning/planning_room.h"
#include "viewer/server/router.h"
#include "viewer/server/viewer_context.h"

namespace kiroku::viewer {

/// `room` and `context`, whose appliance log gets an entry for each plan that is opened, must outlive the
/// router.
void add_planning_routes(Router& router, PlanningRoom& room, ViewerContext& context);

}  // namespace kiroku::viewer
