// kiroku-full: every command of kiroku, with all the libraries they need. People start it through kiroku.

#include <algorithm>
#include <string>

#include "apps/programs/command_list.h"
#include "base/process_hardening.h"
#include "recorder/source/source_guard.h"

namespace {

constexpr const char* kOverview =
    R"(kiroku records operations so that a recording can be proved whole, and when it was made.

  kiroku init --demo                                   a home to try things out
  kiroku record --endoscope synthetic:endoscope --room synthetic:room \
      --vitals synthetic:patient --duration 20s        a recording without any camera
  kiroku cases                                         what is recorded
  kiroku verify CASE                                   is it whole, and when did it exist?
  kiroku report CASE -o report.pdf                     the same, for a court to read
  kiroku export CASE --stream endoscope -o film.ts     the pictures, for a recipient
)";

/// The overview, with the names of the commands of which it shows no example.
std::string overview() {
  std::string others;
  for (const kiroku::apps::CommandPlace& command : kiroku::apps::kCommandPlaces) {
    const std::string name(command.name);
    if (std::string_view(kOverview).find("  kiroku " + name + " ") != std::string_view::npos) continue;
    others += (others.empty() ? "" : ", ") + name;
  }
  return kOverview + ("\nOther commands: " + others) +
         ".\n'kiroku --help' lists them all, 'kiroku COMMAND --help' explains one.\n";
}

kiroku::apps::Command& command_named(kiroku::apps::Command& root, const std::string& name) {
  const auto found = std::find_if(root.commands().begin(), root.commands().end(),
                                  [&](const auto& command) { return command->name() == name; });
  return **found;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace kiroku::apps;
  kiroku::harden_process();
  Program program("kiroku", "records operations, sealed and time-stamped, and proves it", overview());
  Command& root = program.root();
  constexpr auto kAll = [](const StatedCommand&) { return true; };
  constexpr auto kOwn = [](const StatedCommand& one) { return one.add != nullptr; };
  add_commands<Commands, kAll>(root);
  add_commands<SimCommands, kOwn>(command_named(root, "sim"));
  add_commands<PlanCommands, kOwn>(command_named(root, "plan"));
  return kiroku::recorder::end_process(program.run(argc, argv));
}
