// Serving a page from a terminal or as a service, until it is told to end. Functions.
#pragma once

#include <functional>
#include <string>

#include "apps/kiroku/home.h"
#include "viewer/server/viewer.h"

namespace kiroku::apps {

/// One sentence a line on standard error. What is returned is thread-safe.
std::function<void(const std::string&)> tell_on_standard_error();

/// Serves until SIGINT or SIGTERM, then brings what runs to its end unless a second signal comes. `started`
/// is called once the server listens, with the address that signs in once without a password: "" but for a
/// demonstration's home on a loopback address. By the main thread, before it has started others.
void serve_until_stopped(
    viewer::ViewerOptions options, const Home& home,
    const std::function<void(const viewer::Viewer& server, const std::string& sign_in)>& started);

}  // namespace kiroku::apps
