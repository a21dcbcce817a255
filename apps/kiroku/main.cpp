// kiroku: what people start. What asks the running recorder is answered here, with a few small libraries:
// loading those of cameras and codecs would take far longer than the answer. Everything else becomes
// kiroku-full.

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <unistd.h>

#include "apps/kiroku/commands.h"

namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 2> kAnsweredHere{"case", "status"};

/// Beside this program, as it is built, or where it is installed.
fs::path full_program() {
  std::error_code failed;
  const fs::path here = fs::read_symlink("/proc/self/exe", failed).parent_path();
  fs::path beside = here / "kiroku-full";
  if (::access(beside.c_str(), X_OK) == 0) return beside;
  return here.parent_path() / "libexec/kiroku/kiroku-full";
}

}  // namespace

int main(int argc, char** argv) {
  using namespace kiroku::apps;
  if (argc > 1 && std::ranges::count(kAnsweredHere, argv[1]) > 0) {
    Program program("kiroku", "records operations, sealed and time-stamped, and proves it", "");
    add_case_command(program.root());
    add_status_command(program.root());
    return program.run(argc, argv);
  }
  const fs::path full = full_program();
  ::execv(full.c_str(), argv);
  print_error("kiroku", "cannot start " + full.string() + ": " + std::strerror(errno) +
                            "; it belongs to this program, so install both anew");
  return kRefused;
}
