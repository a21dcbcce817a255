// A QR code (ISO/IEC 18004) as a figure. Pure function, thread-safe.
#pragma once

#include <string>
#include <string_view>

#include "viewer/report/figure.h"

namespace kiroku::report {

/// `bytes` in byte mode, error correction M (15 % may be lost), with the quiet zone of four modules; `side`
/// in points. Throws kiroku::Error where they are more than a QR code holds (2,331 bytes).
Figure qr_figure(std::string_view bytes, double side, std::string description);

}  // namespace kiroku::report
