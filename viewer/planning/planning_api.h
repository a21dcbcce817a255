// The planner's part of the API (docs/viewer.md, "Planning").
#pragma once

#include "viewer/planning/planning_room.h"
#include "viewer/server/router.h"

namespace kiroku::viewer {

/// `room` must outlive the router.
void add_planning_routes(Router& router, PlanningRoom& room);

}  // namespace kiroku::viewer
