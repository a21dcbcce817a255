// What verification found, for machines. Pure function.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "archive/verifier.h"

namespace kiroku::apps {

/// {"case", "verdict", "time", "device", "opened", "closed", counts, "streams": […], "brackets": […],
/// "findings": [{"code", "severity", "file", "entry", "offset", "text"}]}; what does not apply is null.
nlohmann::ordered_json report_json(const archive::VerificationReport& report);

}  // namespace kiroku::apps
