// Entries of the appliance log for people. Pure functions, thread-safe.
#pragma once

#include <string>

namespace kiroku::apps {

/// What an entry says beyond its number, time and type: "case=…  size=…". `line` must be an entry.
std::string entry_details(const std::string& line);

}  // namespace kiroku::apps
