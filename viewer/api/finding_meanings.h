// What findings mean, beside them in answers of the API. Pure, thread-safe.
#pragma once

#include <nlohmann/json.hpp>

namespace kiroku::viewer {

/// Gives each finding of `report` (archive/verify/report_json.h) a `meaning`: {"en", "ja"}, one sentence
/// each, by its code.
void add_meanings(nlohmann::ordered_json& report);

}  // namespace kiroku::viewer
