// What makes a PDF one for archives: PDF/A-3b (ISO 19005-3:2012, conformance level B), by qpdf. Thread-safe.
#pragma once

#include "base/bytes.h"
#include "viewer/report/document.h"

namespace kiroku::report {

/// The PDF as Cairo wrote it, and with it what ISO 19005-3 asks for besides embedded fonts: the colours'
/// meaning (6.2.3: sRGB as output intent), XMP metadata with the claim of part 3, level B (6.6.2.1, 6.6.4), a
/// file identifier (6.1.3), links that are printed (6.3.2), how glyphs are found (6.2.11.3.2), and the
/// document's attachments as associated files (6.8). Deterministic. Throws kiroku::Error.
Bytes make_archival(ByteView pdf, const Document& document);

}  // namespace kiroku::report
