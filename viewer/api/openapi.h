// The description of the API, kept in the program.
#pragma once

#include <string_view>

namespace kiroku::viewer {

/// viewer/api/openapi.json.
std::string_view openapi_text();

}  // namespace kiroku::viewer
