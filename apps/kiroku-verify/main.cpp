// kiroku-verify: judges cases and excerpts, and nothing else. Needs OpenSSL and no home.

#include "apps/common/command_line.h"
#include "apps/verify/verify_command.h"
#include "base/process_hardening.h"

int main(int argc, char** argv) {
  using namespace kiroku::apps;
  kiroku::harden_process();  // --identity is a key, and the folder may be anybody's
  Program program("kiroku-verify", "tells whether a recorded case is whole and when it existed", "");
  make_verify_command(program.root(), VerifyExtras{});
  return program.run(argc, argv);
}
