// Where a page of the list of cases ended, as a text that asks for what follows. Functions; thread-safe.
#pragma once

#include <optional>
#include <string>

#include "fleet/catalogue/fleet_catalogue.h"

namespace kiroku::apps {

/// "2026-08-05T09:15:02.000123Z,or-1,20260805T091502Z-3f9c21ab".
std::string page_place(const fleet::FleetCase& last);
/// Nothing for a text that is none.
std::optional<fleet::CaseQuery::Place> parse_page_place(const std::string& text);

}  // namespace kiroku::apps
