// `kiroku view`, which serves the viewer (docs/reference/viewer.md).
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

void add_view_command(Command& program);

}  // namespace kiroku::apps
