// The one JSON object that --json prints.
#pragma once

#include <nlohmann/json_fwd.hpp>

namespace kiroku::apps {

/// On standard output, indented, keys in the order they were set; bytes that are no UTF-8 (file names)
/// replaced.
void print_json(const nlohmann::ordered_json& object);

}  // namespace kiroku::apps
