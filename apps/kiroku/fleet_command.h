// 'kiroku fleet' adds itself to the program.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

void add_fleet_command(Command& program);

}  // namespace kiroku::apps
