// Completion scripts made from what the program's commands state about themselves, so that they never fall
// behind. Pure functions.
#pragma once

#include <string>

#include "apps/common/command_line.h"

namespace kiroku::apps {

std::string bash_completion(const Command& program);
std::string zsh_completion(const Command& program);

}  // namespace kiroku::apps
