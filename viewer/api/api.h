// The handlers of the API (viewer/api/openapi.json), a file each. `context` must outlive the router.
#pragma once

#include "viewer/api/viewer_context.h"
#include "viewer/http/router.h"

namespace kiroku::viewer {

class SignInLink;

/// All of them.
void add_routes(Router& router, ViewerContext& context, SignInLink& link);

/// Signing in and out, by password or once by `link`; unlocking.
void add_session_routes(Router& router, ViewerContext& context, SignInLink& link);
/// What of it a hospital's page has: context.home().stored is there.
void add_fleet_routes(Router& router, ViewerContext& context, SignInLink& link);

/// The list of the archive's cases.
void add_case_list_routes(Router& router, ViewerContext& context);
/// The list of all appliances' cases in a store, and of the appliances.
void add_stored_case_routes(Router& router, ViewerContext& context);
/// All rooms of all appliances that report, and which may: context.home().fleet_rooms is there.
void add_fleet_room_routes(Router& router, ViewerContext& context);
/// One case.
void add_case_routes(Router& router, ViewerContext& context);
/// Watching a case: viewing copies, thumbnails, archived pictures, vital signs, the time line.
void add_playback_routes(Router& router, ViewerContext& context);
/// Plans beside recordings, as they were made and kept.
void add_comparison_routes(Router& router, ViewerContext& context);
/// Steps of a plan matched by hand, and comparisons made of that.
void add_matching_routes(Router& router, ViewerContext& context);
/// Verifying in the background.
void add_verification_routes(Router& router, ViewerContext& context);
/// To what a case's patient consented.
void add_consent_routes(Router& router, ViewerContext& context);
/// Plain media and sealed excerpts as files, for a purpose where the site demands one.
void add_export_routes(Router& router, ViewerContext& context);
void add_log_routes(Router& router, ViewerContext& context);
void add_user_routes(Router& router, ViewerContext& context);
/// What the running recorder says, and what it is told.
void add_room_routes(Router& router, ViewerContext& context);
/// Pictures while they are recorded.
void add_live_routes(Router& router, ViewerContext& context);
/// Who looks on in a room, and where they point.
void add_pointing_routes(Router& router, ViewerContext& context);
/// What programs behind the viewer answer, and whether they do.
void add_workplace_routes(Router& router, ViewerContext& context);
/// Guests who look on in a room.
void add_invitation_routes(Router& router, ViewerContext& context);

}  // namespace kiroku::viewer
