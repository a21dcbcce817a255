// The words by which every command explains a time that it takes.
#pragma once

#include <string>

#include "base/time_text.h"

namespace kiroku::apps {

/// Of a moment of a case.
inline const std::string kTimeHelp =
    "time from the start of the case: " + std::string(kTimeForms) + "; or UTC, as RFC 3339 writes it";
/// Of a length of time: `what` comes first ("ends by itself after").
inline std::string duration_help(const std::string& what) { return what + ": " + std::string(kTimeForms); }

}  // namespace kiroku::apps
