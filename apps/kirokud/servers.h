// The hook and the viewer that kirokud serves beside recording, which goes first.
#pragma once

#include <chrono>
#include <memory>

#include "apps/configuration/configuration.h"
#include "apps/configuration/viewer_configuration.h"
#include "apps/kirokud/kept_server.h"
#include "apps/kirokud/room_setup.h"
#include "recorder/daemon/daemon.h"
#include "recorder/daemon/http_server.h"
#include "viewer/viewer.h"

namespace kiroku::apps {

/// How long the viewer's requests may take to their end once kirokud ends.
inline constexpr std::chrono::seconds kLongestEndOfViewer{20};

/// The hook's token; "" where there is to be no hook. Throws kiroku::Error for one that cannot be used.
std::string hook_token(const Home& home, const Configuration& configuration);

/// Why the viewer's certificate cannot be used, a sentence; "" where it can, or there is to be none.
std::string viewer_certificate_problem(const Home& home, const ViewerConfiguration& asked);

using KeptHttp = KeptServer<recorder::HttpServer>;
using KeptViewer = KeptServer<viewer::Viewer>;

/// Metrics and the hook, where an address is configured. That it cannot be listened on, or that the token
/// cannot be used, so that there are metrics alone, ends no recorder: it is told, also to the daemon. All
/// that is referred to must outlive what is returned.
std::unique_ptr<KeptHttp> serve_http(const Home& home, const Configuration& configuration,
                                     recorder::Daemon& daemon);

/// The viewer with live pictures, where one is configured. That it cannot be served ends no recorder, and is
/// told likewise.
std::unique_ptr<KeptViewer> serve_viewer(const Home& home, const Configuration& configuration,
                                         const ViewerConfiguration& asked, const WritableHome& shared,
                                         LookingOn& looking_on, recorder::Daemon& daemon);

/// False, with all of it left behind, where a request does not come to its end: the process must end without
/// destroying what it may still use.
bool ends_in_time(std::unique_ptr<KeptViewer> viewer);

}  // namespace kiroku::apps
