// 'kiroku log publish' and 'kiroku log follow'.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

void add_log_publish_command(Command& log);
void add_log_follow_command(Command& log);

}  // namespace kiroku::apps
