// kiroku-media: the commands of kiroku that record, show and hand over, with the libraries of cameras and
// codecs and without those of solvers and of finding organs in pictures, which take as long to load. People
// start it through kiroku.

#include "apps/programs/command_list.h"
#include "base/process_hardening.h"
#include "recorder/source/source_guard.h"

int main(int argc, char** argv) {
  using namespace kiroku::apps;
  kiroku::harden_process();
  Program program("kiroku", "records operations, sealed and time-stamped, and proves it", "");
  constexpr auto kHere = [](const StatedCommand& one) { return one.by == AnsweredBy::kMedia; };
  add_commands<Commands, kHere>(program.root());
  return kiroku::recorder::end_process(program.run(argc, argv));
}
