// 'kiroku log prove': a case's end in the appliance log, proved to whoever has no log.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

/// Below 'kiroku log'.
void add_log_prove_command(Command& log);

}  // namespace kiroku::apps
