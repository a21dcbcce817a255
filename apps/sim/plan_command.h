// 'kiroku plan': planned operations, for a person at a terminal.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

void add_plan_command(Command& program);

}  // namespace kiroku::apps
