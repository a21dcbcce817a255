// kiroku: what people start. What needs only a few small libraries is answered here: loading those of
// cameras and codecs would often take far longer than the answer. What simulates becomes
// kiroku-sim, everything else kiroku-full.

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <unistd.h>

#include "apps/kiroku/blas_kernels.h"
#include "apps/kiroku/commands.h"

namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 7> kAnsweredHere{"case",   "cases", "log",   "seal",
                                                        "status", "token", "unseal"};
constexpr std::array<std::string_view, 2> kSimulates{"plan", "sim"};
constexpr std::array<std::string_view, 8> kNeedMore{"drr-film", "pick",  "render",   "replay",
                                                    "seal",     "serve", "transfer", "verify"};

/// Commands of 'sim' and 'plan' that compute; what makes pictures, takes a home or lists all
/// commands needs every library.
bool simulates(int argc, const char* const* argv) {
  return argc > 2 && std::ranges::count(kSimulates, argv[1]) > 0 && argv[2][0] != '-' &&
         std::ranges::count(kNeedMore, argv[2]) == 0;
}

/// Beside this program, as it is built, or where it is installed.
fs::path program(const std::string& name) {
  std::error_code failed;
  const fs::path here = fs::read_symlink("/proc/self/exe", failed).parent_path();
  fs::path beside = here / name;
  if (::access(beside.c_str(), X_OK) == 0) return beside;
  return here.parent_path() / "libexec/kiroku" / name;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace kiroku::apps;
  if (argc > 1 && std::ranges::count(kAnsweredHere, argv[1]) > 0) {
    Program answers("kiroku", "records operations, sealed and time-stamped, and proves it", "");
    add_case_command(answers.root());
    add_cases_command(answers.root());
    add_log_command(answers.root());
    add_seal_command(answers.root());
    add_status_command(answers.root());
    add_token_command(answers.root());
    add_unseal_command(answers.root());
    return answers.run(argc, argv);
  }
  const fs::path other = program(simulates(argc, argv) ? "kiroku-sim" : "kiroku-full");
  ask_for_wide_blas_kernels();
  ::execv(other.c_str(), argv);
  print_error("kiroku", "cannot start " + other.string() + ": " + std::strerror(errno) +
                            "; it belongs to this program, so install both anew");
  return kRefused;
}
