// Runs a program under a filter of system calls, for machines and units that have one:
//   under_filter refuse NAME[,NAME...] PROGRAM [ARGUMENT...]   these calls fail with EPERM, all others are
//   allowed under_filter allow FILE PROGRAM [ARGUMENT...]              calls that FILE does not name, one a
//   line, fail with
//                                                              EPERM, as under SystemCallFilter= of a unit
// Exit status: the program's; 3 where the filter cannot be made.

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <seccomp.h>
#include <sstream>
#include <string>
#include <unistd.h>

int main(int argc, char** argv) {
  if (argc < 4) return 3;
  const bool refuses = std::string(argv[1]) == "refuse";
  constexpr std::uint32_t kRefused = SCMP_ACT_ERRNO(EPERM);
  void* const filter = ::seccomp_init(refuses ? SCMP_ACT_ALLOW : kRefused);
  if (filter == nullptr) return 3;
  const auto add = [&](const std::string& name) {
    const int number = ::seccomp_syscall_resolve_name(name.c_str());
    // Of another processor.
    return number == __NR_SCMP_ERROR ||
           ::seccomp_rule_add(filter, refuses ? kRefused : SCMP_ACT_ALLOW, number, 0) == 0;
  };
  std::ifstream file(argv[2]);
  std::istringstream list(argv[2]);
  std::istream& names = refuses ? static_cast<std::istream&>(list) : file;
  for (std::string name; std::getline(names, name, refuses ? ',' : '\n');) {
    if (!add(name)) return 3;
  }
  // What starts the program.
  if (!refuses && !add("execve")) return 3;
  if (::seccomp_load(filter) != 0) return 3;
  ::execv(argv[3], argv + 3);
  std::perror(argv[3]);
  return 3;
}
