#include <iostream>
#include <memory>

#include "apps/kiroku/commands.h"
#include "apps/kiroku/completion.h"

namespace kiroku::apps {

void add_completion_command(Command& program) {
  Command& command =
      program.add_command("completion", "prints a script that completes commands and options in a shell");
  const auto shell = std::make_shared<std::string>();
  command.choice_argument("SHELL", {"bash", "zsh"}, *shell, "bash or zsh");
  command.example("source <(kiroku completion bash)",
                  "completes in this shell; put it into ~/.bashrc to keep it");
  command.example("kiroku completion zsh > ~/.zfunc/_kiroku", "for zsh, where ~/.zfunc is in $fpath");
  command.on_run([shell, &program] {
    std::cout << (*shell == "bash" ? bash_completion(program) : zsh_completion(program));
    return int(kDone);
  });
}

}  // namespace kiroku::apps
