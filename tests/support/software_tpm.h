// A TPM 2.0 in a process of its own, by swtpm (https://github.com/stefanberger/swtpm), that a test takes away
// and brings back.
#pragma once

#include <array>
#include <csignal>
#include <filesystem>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include <vector>

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
    // Nobody reads what it logs: at a higher level it would stop answering once the pipe is full.
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
                   "fd=1,level=1"};
    process_.emplace(run);
    while (!accepts()) {
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
  /// Measures something into a register of the SHA-256 bank, as a boot loader does. Only while nobody else is
  /// connected: it takes one connection at a time, as the next two do.
  void measure(unsigned pcr, unsigned char what) {
    std::vector<unsigned char> command{0x80, 0x02, 0, 0,
                                       0,    0x41, 0, 0,
                                       0x01, 0x82,  // TPM2_PCR_Extend
                                       0,    0,    0, static_cast<unsigned char>(pcr)};
    append_empty_password(command);
    command.insert(command.end(), {0, 0, 0, 1, 0, 0x0b});
    command.insert(command.end(), 32, what);
    ask(command);
  }
  /// Switches its SHA-256 bank of registers on or off, from its next start on.
  void keep_sha256_bank(bool keep) {
    std::vector<unsigned char> command{0x80, 0x02, 0, 0,   0, 0x25, 0, 0, 0x01, 0x2b,  // TPM2_PCR_Allocate
                                       0x40, 0,    0, 0x0c};                           // TPM_RH_PLATFORM
    append_empty_password(command);
    const unsigned char bits = keep ? 0xff : 0;
    command.insert(command.end(), {0, 0, 0, 1, 0, 0x0b, 3, bits, bits, bits});
    ask(command);
  }
  /// It takes commands and answers none, until hang(false).
  void hang(bool hangs = true) { process_->signal(hangs ? SIGSTOP : SIGCONT); }

 private:
  static void append_empty_password(std::vector<unsigned char>& command) {
    command.insert(command.end(), {0, 0, 0, 9, 0x40, 0, 0, 9, 0, 0, 0, 0, 0});  // TPM_RS_PW
  }
  /// A connection, or -1.
  [[nodiscard]] int connected() const {
    const int descriptor = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const std::string path = socket().string();
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    if (::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0)
      return descriptor;
    ::close(descriptor);
    return -1;
  }
  /// Its socket is there before it listens.
  [[nodiscard]] bool accepts() const {
    const int descriptor = connected();
    if (descriptor >= 0) ::close(descriptor);
    return descriptor >= 0;
  }
  /// Throws unless the TPM says that it did so.
  void ask(const std::vector<unsigned char>& command) const {
    const int descriptor = connected();
    std::array<unsigned char, 64> answer{};
    const bool answered =
        descriptor >= 0 &&
        ::write(descriptor, command.data(), command.size()) == static_cast<ssize_t>(command.size()) &&
        ::read(descriptor, answer.data(), answer.size()) >= 10;
    ::close(descriptor);
    // A head of ten bytes, whose last four are the return code.
    if (!answered || answer[6] != 0 || answer[7] != 0 || answer[8] != 0 || answer[9] != 0)
      throw std::runtime_error("swtpm refused a command of the test");
  }
  [[nodiscard]] std::filesystem::path socket() const { return folder_ / "tpm"; }
  std::filesystem::path folder_;
  std::optional<Process> process_;
};

}  // namespace kiroku::test
