// kiroku-decoder: demuxes and decodes what others wrote or sent, in a box (media/box/child.h). Other programs
// start it; it has nothing to say to a person.

#include <cstdio>
#include <string_view>

#include "recorder/source/source_box.h"

int main(int argc, char** argv) {
  const std::string_view role = argc == 2 ? argv[1] : "";
  if (role == "source") kiroku::recorder::run_source_box();
  std::fputs("kiroku-decoder: only kiroku and kirokud start this program, to decode in a process without keys\n",
             stderr);
  return 2;
}
