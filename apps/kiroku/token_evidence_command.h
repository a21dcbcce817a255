// `kiroku token evidence`: what an evidence record proves of files, whoever made it.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

void add_token_evidence_command(Command& token);

}  // namespace kiroku::apps
