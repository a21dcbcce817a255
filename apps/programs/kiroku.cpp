// kiroku: what people start. What needs only a few small libraries is answered here: loading those of
// cameras and codecs would often take far longer than the answer. What records and shows becomes
// kiroku-media, what simulates kiroku-sim, everything else kiroku-full.

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <unistd.h>

#include "apps/kiroku/blas_kernels.h"
#include "apps/programs/command_list.h"
#include "base/process_hardening.h"

namespace {

namespace fs = std::filesystem;

using kiroku::apps::AnsweredBy;

template <typename Places>
bool answers(const Places& places, std::string_view name, AnsweredBy by) {
  return std::ranges::any_of(places, [&](const auto& one) { return one.name == name && one.by == by; });
}

/// Commands of 'sim' and 'plan' that compute; what makes pictures, takes a home, lists all commands or asks
/// which one was meant needs every library.
bool simulates(int argc, const char* const* argv) {
  if (argc < 3) return false;
  const std::string_view group = argv[1], name = argv[2];
  return (group == "sim" && answers(kiroku::apps::kSimPlaces, name, AnsweredBy::kSim)) ||
         (group == "plan" && answers(kiroku::apps::kPlanPlaces, name, AnsweredBy::kSim));
}

/// The program that answers what this one does not.
const char* other_program(int argc, const char* const* argv) {
  if (simulates(argc, argv)) return "kiroku-sim";
  const bool media = argc > 1 && answers(kiroku::apps::kCommandPlaces, argv[1], AnsweredBy::kMedia);
  return media ? "kiroku-media" : "kiroku-full";
}

/// Beside this program, as it is built, or where it is installed.
fs::path beside(const std::string& name) {
  std::error_code failed;
  const fs::path here = fs::read_symlink("/proc/self/exe", failed).parent_path();
  fs::path built = here / name;
  if (::access(built.c_str(), X_OK) == 0) return built;
  return here.parent_path() / "libexec/kiroku" / name;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace kiroku::apps;
  kiroku::harden_process();
  if (argc > 1 &&
      (answers(kCommandPlaces, argv[1], AnsweredBy::kSmall) || argv[1] == std::string_view("--version"))) {
    Program program("kiroku", "records operations, sealed and time-stamped, and proves it", "");
    constexpr auto kHere = [](const StatedCommand& one) { return one.by == AnsweredBy::kSmall; };
    add_commands<Commands, kHere>(program.root());
    return program.run(argc, argv);
  }
  const fs::path other = beside(other_program(argc, argv));
  ask_for_wide_blas_kernels();
  ::execv(other.c_str(), argv);
  print_error("kiroku", "cannot start " + other.string() + ": " + std::strerror(errno) +
                            "; it belongs to this program, so install both anew");
  return kRefused;
}
