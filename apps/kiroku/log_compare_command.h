// 'kiroku log compare': two appliance logs side by side.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

/// Below 'kiroku log'.
void add_log_compare_command(Command& log);

}  // namespace kiroku::apps
