// Names under which people save documents from the page. Functions, thread-safe.
#pragma once

#include <string>

namespace kiroku::viewer {

/// Refusal 400 for a name that is none of one file in its folder; `what` is saved: "a plan".
void check_new_file_name(const std::string& name, const std::string& what);

}  // namespace kiroku::viewer
