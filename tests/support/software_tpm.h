// A TPM 2.0 in a process of its own, by swtpm (https://github.com/stefanberger/swtpm), that a test takes away
// and brings back.
#pragma once

#include <csignal>
#include <filesystem>
#include <optional>
#include <string>

#include "tests/support/process.h"

namespace kiroku::test {

class SoftwareTpm {
 public:
  static bool is_installed() { return std::filesystem::exists("/usr/bin/swtpm"); }
  static constexpr const char* kWhySkipped = "it needs swtpm (deploy/dependencies, group test)";

  /// Its state and its socket lie in `folder`, whose path is short enough for a socket.
  explicit SoftwareTpm(std::filesystem::path folder) : folder_(std::move(folder)) {
    std::filesystem::create_directories(folder_);
    start();
  }
  [[nodiscard]] std::string tcti() const { return "swtpm:path=" + socket().string(); }

  /// As after power is back: what it holds for good is there, what it was asked to load is not.
  void start() {
    Process::Options run;
    run.command = {"/usr/bin/swtpm",
                   "socket",
                   "--tpm2",
                   "--tpmstate",
                   "dir=" + folder_.string(),
                   "--server",
                   "type=unixio,path=" + socket().string(),
                   "--ctrl",
                   "type=unixio,path=" + socket().string() + ".ctrl",
                   "--flags",
                   "startup-clear",
                   "--log",
                   "fd=1,level=5"};
    process_.emplace(run);
    while (!std::filesystem::exists(socket().string() + ".ctrl") || !std::filesystem::exists(socket())) {
      if (process_->wait_for("rror", std::chrono::seconds(0))) break;
    }
  }
  void take_away() {
    process_->signal(SIGTERM);
    process_->wait();
    process_.reset();
    std::filesystem::remove(socket());
    std::filesystem::remove(socket().string() + ".ctrl");
  }
  /// It takes commands and answers none, until hang(false).
  void hang(bool hangs = true) { process_->signal(hangs ? SIGSTOP : SIGCONT); }

 private:
  [[nodiscard]] std::filesystem::path socket() const { return folder_ / "tpm"; }
  std::filesystem::path folder_;
  std::optional<Process> process_;
};

}  // namespace kiroku::test
