// The handlers of the API (viewer/server/openapi.json), a file each. `context` must outlive the router.
#pragma once

#include "viewer/server/router.h"
#include "viewer/server/viewer_context.h"

namespace kiroku::viewer {

class SignInLink;

/// Signing in and out, by password or once by `link`; unlocking.
void add_session_routes(Router& router, ViewerContext& context, SignInLink& link);
/// The list of cases, and one of them.
void add_case_routes(Router& router, ViewerContext& context);
/// Watching a case: viewing copies, thumbnails, archived pictures, vital signs, the time line.
void add_playback_routes(Router& router, ViewerContext& context);
/// What the running recorder says, and what it is told.
void add_room_routes(Router& router, ViewerContext& context);

}  // namespace kiroku::viewer
