// 'kiroku train': experiments and training on the simulation core, for a person at a terminal.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

void add_train_command(Command& program);

/// Parts of it.
void add_train_haptic_rate_command(Command& train);

}  // namespace kiroku::apps
