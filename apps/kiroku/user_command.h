// `kiroku user`: who may sign in to the viewer.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

void add_user_command(Command& program);

}  // namespace kiroku::apps
