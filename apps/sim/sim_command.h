// 'kiroku sim': what the simulation core does for a person at a terminal.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

void add_sim_command(Command& program);

}  // namespace kiroku::apps
