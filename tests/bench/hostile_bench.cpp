// What verifying hostile folders costs: for each form of tests/support/hostile_case.h the processor time, in
// s per 10 MB of what the folder holds, and the peak memory of a process that does nothing else.
//   hostile_bench [MB=10] [NAME…]
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <string>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/support/hostile_case.h"
#include "tests/support/temporary_folder.h"

namespace {

using namespace kiroku;  // NOLINT(google-build-using-namespace)

/// In a process of its own, so that its memory is its own; ended after two minutes of processor time.
rusage in_child(const std::function<void()>& work) {
  constexpr rlim_t kMostSeconds = 120;
  std::fflush(stdout);
  const pid_t child = ::fork();
  if (child == 0) {
    const rlimit limit{kMostSeconds, kMostSeconds};
    ::setrlimit(RLIMIT_CPU, &limit);
    work();
    std::fflush(stdout);
    std::_Exit(0);
  }
  int status = 0;
  rusage usage{};
  ::wait4(child, &status, 0, &usage);
  if (!WIFEXITED(status)) {
    std::printf("%s", WIFSIGNALED(status) && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL)
                          ? "(cut off) "
                          : "(died) ");
  }
  return usage;
}

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) / 1e6;
}

}  // namespace

int main(int count, char** arguments) {
  const double megabytes = count > 1 ? std::stod(arguments[1]) : 10;
  std::printf("%-50s %10s %14s %9s  %s\n", "form", "MB", "s per 10 MB", "peak MB", "verdict");
  for (const test::HostileForm& form : test::hostile_forms()) {
    bool wanted = count <= 2;
    for (int i = 2; i < count; ++i) {
      wanted = wanted || form.name == arguments[i];
    }
    if (!wanted) {
      continue;
    }
    const test::TemporaryFolder folder(test::quick_parent());
    in_child([&] { form.write(folder.path(), static_cast<std::uint64_t>(megabytes * 1e6)); });
    const double size = static_cast<double>(test::bytes_below(folder.path())) / 1e6;
    std::printf("%-50s %10.1f ", form.name.c_str(), size);
    const rusage usage = in_child([&] {
      const archive::VerificationReport report = test::verify_hostile(folder.path(), 2);
      std::printf("%-30s ", (std::string(archive::verdict_name(report.verdict)) + ", " +
                             std::to_string(report.findings.size()) + " findings")
                                .c_str());
    });
    std::printf("%9.2f %9.0f\n", (seconds(usage.ru_utime) + seconds(usage.ru_stime)) * 10 / size,
                static_cast<double>(usage.ru_maxrss) / 1024);
  }
  return 0;
}
