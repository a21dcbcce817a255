// What hostile folders cost: for each form of tests/support/hostile_case.h, verified, and for each command of
// a home whose log, notes or records somebody else wrote. The processor time, also per 10 MB of what was
// given (512 bytes for each name counted in, as a tar file has them), how long it takes with two threads, and
// the peak memory of a process that does nothing else.
//   hostile_bench [MB=10] [NAME…]
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

#include "crypto/cosignature.h"
#include "crypto/encoding.h"
#include "tests/support/build_paths.h"
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

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;

std::string read_all(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// `kiroku`, in the place of this process, with its output thrown away.
[[noreturn]] void become_kiroku(const fs::path& home, const Arguments& arguments) {
  const int nowhere = ::open("/dev/null", O_WRONLY);
  ::dup2(nowhere, STDOUT_FILENO);
  ::dup2(nowhere, STDERR_FILENO);
  ::setenv("KIROKU_HOME", home.c_str(), 1);
  const std::string program = test::built_file("kiroku");
  std::vector<char*> words{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  ::execv(program.c_str(), words.data());
  std::_Exit(127);
}

/// A command of a home in which somebody else wrote something.
struct HostileCommand {
  std::string name;
  /// Writes about so many bytes; what the command is called with.
  std::function<Arguments(const fs::path& home, std::uint64_t bytes)> write;
};

/// Lines of a log that is no longer the home's own, all with this text.
void write_log(const fs::path& home, std::uint64_t bytes, const std::string& text) {
  const fs::path folder = home / "archive";
  fs::remove_all(folder / "log");
  test::HostileLog log(folder);
  while (log.bytes() < bytes) log.add(archive::AccessEntry{test::HostileCase::kCaseId, text, "x"});
}

std::string repeated(std::string_view text, std::size_t bytes) {
  std::string out;
  while (out.size() + text.size() <= bytes) out += text;
  return out;
}

/// The log's newest note with a hundred lines of strangers, a megabyte in all; so many of them.
Arguments write_notes(const fs::path& home, std::uint64_t bytes) {
  constexpr std::size_t kNoteBytes = 950'000, kLines = 99;
  std::vector<fs::path> notes(fs::directory_iterator(home / "archive/log/checkpoints"), {});
  std::string note = read_all(*std::max_element(notes.begin(), notes.end()));
  for (std::size_t i = 0; i < kLines; ++i) {
    note += "\u2014 " + std::string(kNoteBytes / kLines - 110, 'n') + std::to_string(i) + " " +
            crypto::to_base64(Bytes(76), crypto::Base64Padding::kPadded) + "\n";
  }
  std::string policy, members;
  for (int i = 0; i < 1'000; ++i) {
    const crypto::CosignerKey key("w" + std::to_string(i), crypto::SigningKey::generate().public_key());
    policy += "witness w" + std::to_string(i) + " " + key.to_string() + "\n";
    members += " w" + std::to_string(i);
  }
  std::ofstream(home / "policy.txt") << policy << "group all 500" << members << "\nquorum all\n";
  Arguments arguments{"log", "--verify", "--witnesses", (home / "policy.txt").string()};
  for (std::uint64_t i = 0; i < std::max<std::uint64_t>(bytes / note.size(), 1); ++i) {
    const fs::path file = home / ("kept" + std::to_string(i) + ".note");
    std::ofstream(file, std::ios::binary) << note;
    arguments.insert(arguments.end(), {"--against", file.string()});
  }
  return arguments;
}

Arguments write_policy(const fs::path& home, std::uint64_t bytes, const std::string& text) {
  std::ofstream(home / "policy.txt") << repeated(text, std::min<std::uint64_t>(bytes, 16U << 20U)) << "\n";
  return {"log", "--verify", "--witnesses", (home / "policy.txt").string()};
}

/// A record of hundreds of thousands of values beside a case.
Arguments write_renewal(const fs::path& home, std::uint64_t bytes) {
  for (const test::HostileForm& form : test::hostile_forms()) {
    if (form.name == "record of many values") form.write(home / "archive", bytes);
  }
  return {"renew", "--take-in", "--dry-run"};
}

std::vector<HostileCommand> hostile_commands() {
  constexpr std::size_t kLong = 900'000;
  const auto of_log = [](const std::string& text, const Arguments& arguments) {
    return [text, arguments](const fs::path& home, std::uint64_t bytes) {
      write_log(home, bytes, text);
      return arguments;
    };
  };
  const std::string turned = repeated("\u202e", kLong);
  return {
      {"list a log: short entries", of_log("", {"log"})},
      {"list a log: short entries, as JSON", of_log("", {"log", "--json"})},
      {"list a log: long texts", of_log(std::string(kLong, 'w'), {"log"})},
      {"list a log: texts that turn a line round", of_log(turned, {"log"})},
      {"list a log: texts that turn a line round, as JSON", of_log(turned, {"log", "--json"})},
      {"list a log: texts of quotation marks", of_log(std::string(kLong / 2, '"'), {"log"})},
      {"witnesses: 1,000, and notes of a hundred lines", write_notes},
      {"witnesses: a policy of one long word",
       [](const fs::path& home, std::uint64_t bytes) { return write_policy(home, bytes, "w"); }},
      {"witnesses: a policy of comments",
       [](const fs::path& home, std::uint64_t bytes) { return write_policy(home, bytes, "#\n"); }},
      {"renew: a record of many values", write_renewal},
  };
}

struct Cost {
  test::Contents given;
  double time = 0, elapsed = 0;
  long peak_kb = 0;
  std::string told;
};

void print(const std::string& name, const Cost& cost) {
  const double sent = static_cast<double>(cost.given.sent());
  std::printf("%-50s %8.1f %8llu %8.2f %12.2f %12.2f %8.0f  %s\n", name.c_str(),
              static_cast<double>(cost.given.bytes) / 1e6, static_cast<unsigned long long>(cost.given.names),
              cost.time, cost.time * 1e7 / sent, cost.elapsed * 1e7 / sent,
              static_cast<double>(cost.peak_kb) / 1024, cost.told.c_str());
  std::fflush(stdout);
}

Cost cost_of(const std::function<void()>& work) {
  Cost cost;
  const auto begin = std::chrono::steady_clock::now();
  const rusage usage = in_child(work);
  cost.elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  cost.time = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  cost.peak_kb = usage.ru_maxrss;
  return cost;
}

Cost cost_of(const test::HostileForm& form, std::uint64_t bytes) {
  const test::TemporaryFolder folder(test::quick_parent());
  in_child([&] { form.write(folder.path(), bytes); });
  const test::TemporaryFolder verdict;
  Cost cost = cost_of([&] {
    const archive::VerificationReport report = test::verify_hostile(folder.path(), 2);
    std::ofstream(verdict / "verdict")
        << archive::verdict_name(report.verdict) << ", " << report.findings.size() << " findings";
  });
  cost.given = test::contents_below(folder.path());
  cost.told = "cut off";
  std::getline(std::ifstream(verdict / "verdict"), cost.told);
  return cost;
}

Cost cost_of(const HostileCommand& command, std::uint64_t bytes) {
  const test::TemporaryFolder folder(test::quick_parent());
  const fs::path home = folder / "home";
  in_child([&] { become_kiroku(home, {"init", "--demo"}); });
  if (!fs::is_directory(home)) {
    throw std::runtime_error(
        "what commands of a home cost is not measured: this build has no 'kiroku'; the preset release has");
  }
  const test::Contents before = test::contents_below(home);
  const Arguments arguments = command.write(home, bytes);
  test::Contents given = test::contents_below(home);
  given.bytes -= before.bytes;
  given.names -= std::min(before.names, given.names);
  Cost cost = cost_of([&] { become_kiroku(home, arguments); });
  cost.given = given;
  return cost;
}

}  // namespace

int main(int count, char** arguments) try {
  const double megabytes = count > 1 ? std::stod(arguments[1]) : 10;
  const auto bytes = static_cast<std::uint64_t>(megabytes * 1e6);
  const auto is_wanted = [&](const std::string& name) {
    return count <= 2 || std::find(arguments + 2, arguments + count, name) != arguments + count;
  };
  std::printf("%-50s %8s %8s %8s %12s %12s %8s  %s\n", "form", "MB", "names", "s", "s per 10 MB", "elapsed",
              "peak MB", "verdict");
  for (const test::HostileForm& form : test::hostile_forms()) {
    if (is_wanted(form.name)) print(form.name, cost_of(form, bytes));
  }
  for (const HostileCommand& command : hostile_commands()) {
    if (is_wanted(command.name)) print(command.name, cost_of(command, bytes));
  }
  return 0;
} catch (const std::exception& error) {
  std::cerr << "hostile_bench: " << error.what() << "\n";
  return 1;
}
