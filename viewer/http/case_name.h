// How one part of an address names a case: by its identifier on an appliance's own viewer, and as
// "or-1~20260805T091502Z-3f9c21ab" where cases of many appliances are served. Functions; thread-safe.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace kiroku::viewer {

/// Whether it is either.
bool is_case_name(std::string_view text);

std::string stored_case_name(std::string_view appliance, std::string_view case_id);
/// Appliance and identifier; nothing for any other text.
std::optional<std::pair<std::string, std::string>> parse_stored_case_name(std::string_view name);

}  // namespace kiroku::viewer
