// kiroku-sim: the commands of kiroku that simulate, without the libraries of cameras and codecs, whose
// loading took a fifth of a small solve. People start it through kiroku.

#include "apps/programs/command_list.h"
#include "base/process_hardening.h"

int main(int argc, char** argv) {
  using namespace kiroku::apps;
  kiroku::harden_process();
  Program program("kiroku", "records operations, sealed and time-stamped, and proves it", "");
  constexpr auto kHere = [](const StatedCommand& one) { return one.by == AnsweredBy::kSim; };
  add_commands<Commands, kHere>(program.root());
  return program.run(argc, argv);
}
