// A document as one HTML page that needs nothing else: style and drawings are inside, scripts there are none.
// Pure function, thread-safe.
#pragma once

#include <string>

#include "viewer/report/document.h"

namespace kiroku::report {

std::string write_html(const Document& document);

}  // namespace kiroku::report
