// kiroku-sim: the commands of kiroku that simulate, without the libraries of cameras and codecs, whose
// loading took a fifth of a small solve. People start it through kiroku.

#include "apps/kiroku/commands.h"
#include "apps/sim/plan_command.h"
#include "apps/sim/sim_command.h"

int main(int argc, char** argv) {
  using namespace kiroku::apps;
  Program program("kiroku", "records operations, sealed and time-stamped, and proves it", "");
  add_sim_command(program.root());
  add_plan_command(program.root());
  return program.run(argc, argv);
}
