#include "apps/kiroku/commands.h"

namespace kiroku::apps {

void add_home_option(Command& command, std::optional<std::string>& into) {
  command.option("--home", "DIR", into, "the home to use", "$KIROKU_HOME, else ~/.local/share/kiroku");
}

}  // namespace kiroku::apps
