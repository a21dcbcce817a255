// The documents' addresses: report and receipt of a case (docs/report.md).
#pragma once

#include "viewer/server/router.h"
#include "viewer/server/viewer_context.h"

namespace kiroku::viewer {

/// `context` must outlive the router.
void add_report_routes(Router& router, ViewerContext& context);

}  // namespace kiroku::viewer
