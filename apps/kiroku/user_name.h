// Who runs this program.
#pragma once

#include <string>

namespace kiroku::apps {

/// As the machine knows it; "uid 1000" where it has no name.
std::string user_name();

}  // namespace kiroku::apps
