#include "viewer/programs/child_program.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <span>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "base/error.h"

namespace kiroku::viewer {
namespace {

[[noreturn]] void fail(const std::string& what) {
  throw Error("a program cannot be started: " + what + ": " + std::strerror(errno));
}

/// Between fork and exec of a process with threads: system calls alone.
[[noreturn]] void become(const char* program, char* const* arguments, std::span<const Descriptor> given,
                         ChildPriority priority, pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(ChildProgram::kNotStarted);  // it ended before that was said
  // The server's handlers are none of the program's: one would swallow what asks the program to end, and wake
  // the server through a descriptor that both have.
  for (int signal = 1; signal < NSIG; ++signal) {
    struct sigaction action {};
    if (::sigaction(signal, nullptr, &action) == 0 && action.sa_handler != SIG_IGN) ::signal(signal, SIG_DFL);
  }
  sigset_t none;
  sigemptyset(&none);
  ::pthread_sigmask(SIG_SETMASK, &none, nullptr);
  ::setpriority(PRIO_PROCESS, 0, static_cast<int>(priority));
  // Copies above all that are wanted first, so that none is written over before it was copied.
  std::array<int, ChildProgram::kMostDescriptors> copies{};
  const int count = static_cast<int>(given.size());
  for (std::size_t i = 0; i < given.size(); ++i)
    copies[i] = ::fcntl(given[i].number(), F_DUPFD_CLOEXEC, count);
  for (std::size_t i = 0; i < given.size(); ++i) {
    if (::dup2(copies[i], static_cast<int>(i)) < 0) ::_exit(ChildProgram::kNotStarted);
  }
  // Connections of the server are none of its concern; a client would wait for what it holds open.
  ::close_range(static_cast<unsigned>(count), ~0U, 0);
  ::execv(program, arguments);
  ::_exit(ChildProgram::kNotStarted);
}

}  // namespace

DescriptorPair make_pipe() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) fail("no pipe");
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

DescriptorPair make_socket_pair() {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) fail("no socket");
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

Descriptor file_of_text(std::string_view text) {
  Descriptor file(::memfd_create("kiroku-given", MFD_CLOEXEC));
  if (!file) fail("no memory for what it is given");
  while (!text.empty()) {
    const ssize_t written = ::write(file.number(), text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) fail("no memory for what it is given");
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  if (::lseek(file.number(), 0, SEEK_SET) != 0) fail("no memory for what it is given");
  return file;
}

ChildProgram::ChildProgram(const std::filesystem::path& program, const std::vector<std::string>& arguments,
                           std::vector<Descriptor> given, ChildPriority priority) {
  if (given.size() > kMostDescriptors) throw Error("a program is given too many descriptors");
  std::vector<std::string> all{program.string()};
  all.insert(all.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& each : all) pointers.push_back(each.data());
  pointers.push_back(nullptr);
  const pid_t parent = ::getpid();
  // Until the program has no handler any more, a signal for it waits.
  sigset_t every, before;
  sigfillset(&every);
  ::pthread_sigmask(SIG_SETMASK, &every, &before);
  process_ = ::fork();
  if (process_ == 0) become(all.front().c_str(), pointers.data(), given, priority, parent);
  const int failed = errno;
  ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
  errno = failed;
  if (process_ < 0) fail("no process");
}

ChildProgram::~ChildProgram() {
  end_by_force();
  wait(std::chrono::milliseconds(0));
}

void ChildProgram::ask_to_end() const {
  if (process_ > 0) ::kill(process_, SIGTERM);
}

void ChildProgram::end_by_force() const {
  if (process_ > 0) ::kill(process_, SIGKILL);
}

int ChildProgram::wait(std::chrono::milliseconds patience) {
  if (process_ <= 0) return -1;
  constexpr auto kLook = std::chrono::milliseconds(20);
  int status = 0;
  pid_t ended = 0;
  for (auto waited = std::chrono::milliseconds(0); waited < patience; waited += kLook) {
    ended = ::waitpid(process_, &status, WNOHANG);
    if (ended != 0) break;
    std::this_thread::sleep_for(kLook);
  }
  if (ended == 0) end_by_force();
  while (ended <= 0 && (ended = ::waitpid(process_, &status, 0)) < 0 && errno == EINTR) {
  }
  process_ = -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

void ProgramListener::take(std::string_view bytes) {
  constexpr std::size_t kLongest = 8192;
  for (const char c : bytes) {
    if (c != '\n') {
      if (line_.size() < kLongest) line_ += c;
      continue;
    }
    line();
    line_.clear();
  }
}

void ProgramListener::line() {
  if (line_.starts_with('{')) {
    const auto told = nlohmann::json::parse(line_, nullptr, false);
    if (told.is_object() && told.contains("doing") && told["doing"].is_string()) {
      const auto share = told.find("share");
      progress_(told["doing"].get<std::string>(), share != told.end() && share->is_number()
                                                      ? std::optional(share->get<double>())
                                                      : std::nullopt);
    }
    return;
  }
  constexpr std::string_view kProgram = "kiroku: ", kWarning = "warning: ";
  std::string_view sentence = line_;
  if (!sentence.starts_with(kProgram)) return;
  sentence.remove_prefix(kProgram.size());
  if (!sentence.starts_with(kWarning)) problem_ = sentence;
}

bool drain(int descriptor, const std::function<void(std::string_view)>& take) {
  std::array<char, 16384> block{};
  const ssize_t got = ::read(descriptor, block.data(), block.size());
  if (got < 0) return errno == EINTR || errno == EAGAIN;
  if (got > 0) take({block.data(), static_cast<std::size_t>(got)});
  return got > 0;
}

}  // namespace kiroku::viewer
