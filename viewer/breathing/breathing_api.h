// The breathing workbench's part of the API (docs/reference/viewer.md, "Breathing").
#pragma once

#include "viewer/api/viewer_context.h"
#include "viewer/breathing/breathing_room.h"
#include "viewer/http/router.h"

namespace kiroku::viewer {

/// `room` and `context`, whose appliance log gets an entry whenever somebody opens the lung, must outlive the
/// router.
void add_breathing_routes(Router& router, BreathingRoom& room, ViewerContext& context);

}  // namespace kiroku::viewer
