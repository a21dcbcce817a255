// The documents' addresses: report and receipt of a case (docs/reference/report.md).
#pragma once

#include "viewer/api/viewer_context.h"
#include "viewer/http/router.h"
#include "viewer/report/language.h"

namespace kiroku::viewer {

/// The language that a document is asked for in: `?language=en` or `ja`, English if it is absent. Refusal 400
/// for others.
report::Language asked_language(const Request& request);

/// `context` must outlive the router.
void add_report_routes(Router& router, ViewerContext& context);

}  // namespace kiroku::viewer
