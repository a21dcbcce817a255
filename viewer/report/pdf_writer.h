// A document as PDF/A-3b (ISO 19005-3, conformance level B), which archives and courts take: A4, page
// numbers, outline, metadata, text that can be selected, and the document's attachments as embedded files.
// Thread-safe.
#pragma once

#include "base/bytes.h"
#include "viewer/report/document.h"

namespace kiroku::report {

/// The same document gives the same bytes where the same fonts and libraries are installed. Throws
/// kiroku::Error where a font is not.
Bytes write_pdf(const Document& document);

}  // namespace kiroku::report
