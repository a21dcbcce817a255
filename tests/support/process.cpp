#include "tests/support/process.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <stdexcept>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <unistd.h>

namespace kiroku::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

struct Pipe {
  int read = -1, write = -1;
};

Pipe make_pipe() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("cannot make a pipe");
  return {ends[0], ends[1]};
}

void close_if_open(int& descriptor) {
  if (descriptor >= 0) ::close(descriptor);
  descriptor = -1;
}

/// Appends what can be read now; false at the end.
bool read_available(int descriptor, std::string& into) {
  std::array<char, 65536> block{};
  const ssize_t got = ::read(descriptor, block.data(), block.size());
  if (got < 0 && (errno == EINTR || errno == EAGAIN)) return true;
  if (got <= 0) return false;
  into.append(block.data(), std::size_t(got));
  return true;
}

[[noreturn]] void become(const Process::Options& options) {
  for (const auto& [name, value] : options.environment) {
    if (value) {
      ::setenv(name.c_str(), value->c_str(), 1);
    } else {
      ::unsetenv(name.c_str());
    }
  }
  if (!options.folder.empty() && ::chdir(options.folder.c_str()) != 0) ::_exit(126);
  std::vector<char*> arguments;
  for (const std::string& argument : options.command)
    arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  ::signal(SIGPIPE, SIG_DFL);
  ::execvp(arguments[0], arguments.data());
  ::_exit(127);
}

}  // namespace

Process::Process(const Options& options) {
  ::signal(SIGPIPE, SIG_IGN);
  if (options.terminal) {
    winsize size{};
    size.ws_row = 25;
    size.ws_col = 120;
    int terminal = -1;
    pid_ = ::forkpty(&terminal, nullptr, nullptr, &size);
    if (pid_ < 0) throw std::runtime_error("cannot make a terminal");
    if (pid_ == 0) become(options);
    ::fcntl(terminal, F_SETFD, FD_CLOEXEC);
    out_ = terminal;
    return;
  }
  Pipe in = make_pipe(), out = make_pipe(), err = make_pipe();
  pid_ = ::fork();
  if (pid_ < 0) throw std::runtime_error("cannot fork");
  if (pid_ == 0) {
    // A session of its own: no terminal of the test's to ask passphrases on.
    ::setsid();
    ::dup2(in.read, STDIN_FILENO);
    ::dup2(out.write, STDOUT_FILENO);
    ::dup2(err.write, STDERR_FILENO);
    become(options);
  }
  for (const int descriptor : {in.read, out.write, err.write}) ::close(descriptor);
  in_ = in.write;
  out_ = out.read;
  err_ = err.read;
  ::fcntl(in_, F_SETFL, O_NONBLOCK);
  pending_input_ = options.input;
  if (pending_input_.empty()) close_if_open(in_);
}

Process::~Process() {
  if (pid_ > 0) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  close_if_open(in_);
  close_if_open(out_);
  close_if_open(err_);
}

bool Process::pump(milliseconds wait) {
  std::array<pollfd, 3> watched{pollfd{out_, POLLIN, 0}, pollfd{err_, POLLIN, 0}, pollfd{in_, POLLOUT, 0}};
  ::poll(watched.data(), watched.size(), int(wait.count()));
  if (out_ >= 0 && watched[0].revents != 0 && !read_available(out_, result_.out)) close_if_open(out_);
  if (err_ >= 0 && watched[1].revents != 0 && !read_available(err_, result_.err)) close_if_open(err_);
  if (in_ >= 0 && watched[2].revents != 0) {
    const ssize_t written = ::write(in_, pending_input_.data(), pending_input_.size());
    if (written > 0) pending_input_.erase(0, std::size_t(written));
    if (pending_input_.empty() || (written < 0 && errno != EAGAIN)) close_if_open(in_);
  }
  return out_ >= 0 || err_ >= 0;
}

bool Process::wait_for(const std::string& text, std::chrono::seconds limit) {
  const auto end = steady_clock::now() + limit;
  const auto found = [&] {
    return result_.out.find(text) != std::string::npos || result_.err.find(text) != std::string::npos;
  };
  while (!found() && steady_clock::now() < end) {
    if (!pump(milliseconds(100))) break;
  }
  return found();
}

bool Process::runs() {
  pump(milliseconds(0));  // or it would wait for room to write
  siginfo_t ended{};
  return ::waitid(P_PID, static_cast<id_t>(pid_), &ended, WEXITED | WNOHANG | WNOWAIT) == 0 &&
         ended.si_pid == 0;
}

void Process::signal(int number) const { ::kill(pid_, number); }

void Process::type(const std::string& text) const {
  if (::write(out_, text.data(), text.size()) < 0) throw std::runtime_error("cannot type");
}

ProcessResult Process::wait(std::chrono::seconds limit) {
  const auto end = steady_clock::now() + limit;
  while (pump(milliseconds(100))) {
    if (steady_clock::now() < end) continue;
    result_.timed_out = true;
    ::kill(pid_, SIGKILL);
    break;
  }
  int state = 0;
  ::waitpid(pid_, &state, 0);
  pid_ = -1;
  result_.status = WIFEXITED(state) ? WEXITSTATUS(state) : 128 + WTERMSIG(state);
  return result_;
}

ProcessResult run_process(const Process::Options& options, std::chrono::seconds limit) {
  return Process(options).wait(limit);
}

}  // namespace kiroku::test
