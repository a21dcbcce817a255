// Steps of a plan matched by hand, points picked, and comparisons made of that, with limits of one's own.
#pragma once

#include <chrono>

#include "viewer/api/viewer_context.h"
#include "viewer/http/router.h"

namespace kiroku::viewer {

/// How long what is waited for may take; then the program that does it is ended.
struct MatchingLimits {
  std::chrono::milliseconds reading = std::chrono::minutes(2);  // a plan and its case, while a request waits
  std::chrono::milliseconds making = std::chrono::hours(6);     // a comparison, while nobody waits
};

/// As add_matching_routes() of api.h.
void add_matching_routes(Router& router, ViewerContext& context, const MatchingLimits& limits);

}  // namespace kiroku::viewer
