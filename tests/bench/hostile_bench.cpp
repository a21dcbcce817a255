// What verifying hostile folders costs: for each form of tests/support/hostile_case.h the processor time,
// also per 10 MB of what the folder holds (512 bytes for each name counted in, as a tar file has them), how
// long it takes with two threads, and the peak memory of a process that does nothing else.
//   hostile_bench [MB=10] [NAME…]
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
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

/// In a process of its own, so that its memory is its own; ended after half a minute of processor time.
rusage in_child(const std::function<void()>& work) {
  constexpr rlim_t kMostSeconds = 30;
  std::fflush(stdout);
  const pid_t child = ::fork();
  if (child == 0) {
    const rlimit limit{kMostSeconds, kMostSeconds};
    ::setrlimit(RLIMIT_CPU, &limit);
    work();
    std::fflush(stdout);
    std::_Exit(0);
  }
  rusage usage{};
  ::wait4(child, nullptr, 0, &usage);
  return usage;
}

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) / 1e6;
}

}  // namespace

int main(int count, char** arguments) {
  const double megabytes = count > 1 ? std::stod(arguments[1]) : 10;
  std::printf("%-50s %8s %8s %8s %12s %12s %8s  %s\n", "form", "MB", "names", "s", "s per 10 MB", "elapsed",
              "peak MB", "verdict");
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
    const test::Contents contents = test::contents_below(folder.path());
    const test::TemporaryFolder verdict;
    const auto begin = std::chrono::steady_clock::now();
    const rusage usage = in_child([&] {
      const archive::VerificationReport report = test::verify_hostile(folder.path(), 2);
      std::ofstream(verdict / "verdict")
          << archive::verdict_name(report.verdict) << ", " << report.findings.size() << " findings";
    });
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
    std::string told = "cut off";
    std::getline(std::ifstream(verdict / "verdict"), told);
    const double time = seconds(usage.ru_utime) + seconds(usage.ru_stime);
    std::printf("%-50s %8.1f %8llu %8.2f %12.2f %12.2f %8.0f  %s\n", form.name.c_str(),
                static_cast<double>(contents.bytes) / 1e6, static_cast<unsigned long long>(contents.names),
                time, time * 1e7 / static_cast<double>(contents.sent()),
                elapsed.count() * 1e7 / static_cast<double>(contents.sent()),
                static_cast<double>(usage.ru_maxrss) / 1024, told.c_str());
  }
  return 0;
}
