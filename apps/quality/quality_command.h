// 'kiroku quality': what each way of coding leaves of a clip.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

void add_quality_command(Command& program);

}  // namespace kiroku::apps
