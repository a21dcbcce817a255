#include "viewer/server/comparison_program.h"

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <poll.h>
#include <string_view>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "base/descriptor.h"
#include "base/error.h"
#include "crypto/remote_identity.h"

namespace kiroku::viewer {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kIdentitySocket = 3;
constexpr int kLowestPriority = 19;
constexpr std::size_t kMostOutput = 4U << 20;
/// What exec() answers when it fails.
constexpr int kNotStarted = 127;

[[noreturn]] void fail(const std::string& what) {
  throw Error("the comparison cannot be started: " + what + ": " + std::strerror(errno));
}

struct Pair {
  Descriptor ours, theirs;
};

Pair make_pipe() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) fail("no pipe");
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

Pair make_socket() {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) fail("no socket");
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

/// A file without a name: a pipe would have to be filled while the program reads.
Descriptor file_of(const std::string& text) {
  Descriptor file(::memfd_create("kiroku-by-hand", MFD_CLOEXEC));
  if (!file) fail("no memory for what was matched");
  std::string_view left = text;
  while (!left.empty()) {
    const ssize_t written = ::write(file.number(), left.data(), left.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) fail("no memory for what was matched");
    left.remove_prefix(static_cast<std::size_t>(written));
  }
  if (::lseek(file.number(), 0, SEEK_SET) != 0) fail("no memory for what was matched");
  return file;
}

struct Given {
  Descriptor input, out, err, socket;
};

/// Between fork and exec of a process with threads: system calls alone.
[[noreturn]] void become(const char* program, char* const* arguments, const Given& given, pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(kNotStarted);  // it ended before that was said
  sigset_t none;
  sigemptyset(&none);
  ::pthread_sigmask(SIG_SETMASK, &none, nullptr);
  ::setpriority(PRIO_PROCESS, 0, kLowestPriority);
  // Copies above all that are wanted first, so that none is written over before it was copied.
  const std::array<int, 4> from{given.input.number(), given.out.number(), given.err.number(),
                                given.socket.number()};
  std::array<int, 4> copies{};
  for (std::size_t i = 0; i < from.size(); ++i)
    copies[i] = ::fcntl(from[i], F_DUPFD_CLOEXEC, kIdentitySocket + 1);
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (::dup2(copies[i], static_cast<int>(i)) < 0) ::_exit(kNotStarted);
  }
  // Connections of the server are none of its concern; a client would wait for what it holds open.
  ::close_range(kIdentitySocket + 1, ~0U, 0);
  ::execv(program, arguments);
  ::_exit(kNotStarted);
}

/// Lines of a program's standard error.
class Listener {
 public:
  explicit Listener(const ComparisonProgramProgress& progress) : progress_(progress) {}
  void take(std::string_view bytes) {
    for (const char c : bytes) {
      if (c != '\n') {
        if (line_.size() < kLongest) line_ += c;
        continue;
      }
      line();
      line_.clear();
    }
  }
  [[nodiscard]] const std::string& problem() const { return problem_; }

 private:
  static constexpr std::size_t kLongest = 8192;
  void line() {
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

  const ComparisonProgramProgress& progress_;
  std::string line_, problem_;
};

/// Takes what can be read; false at the end.
bool drain(int descriptor, const std::function<void(std::string_view)>& take) {
  std::array<char, 16384> block{};
  const ssize_t got = ::read(descriptor, block.data(), block.size());
  if (got < 0) return errno == EINTR || errno == EAGAIN;
  if (got > 0) take({block.data(), static_cast<std::size_t>(got)});
  return got > 0;
}

void listen_until_end(pid_t child, int out, int err, ComparisonProgramEnd& end, Listener& listener,
                      const std::atomic<bool>& stop) {
  constexpr int kPatienceMs = 200;
  constexpr auto kGrace = std::chrono::seconds(5);
  std::array<pollfd, 2> ends{{{out, POLLIN, 0}, {err, POLLIN, 0}}};
  std::optional<Clock::time_point> asked_to_stop;
  while (ends[0].fd >= 0 || ends[1].fd >= 0) {
    if (stop && !asked_to_stop) {
      asked_to_stop = Clock::now();
      ::kill(child, SIGTERM);
    } else if (asked_to_stop && Clock::now() - *asked_to_stop > kGrace) {
      ::kill(child, SIGKILL);
    }
    if (::poll(ends.data(), ends.size(), kPatienceMs) <= 0) continue;
    if (ends[0].revents != 0 && !drain(out, [&](std::string_view bytes) {
          if (end.out.size() < kMostOutput) end.out += bytes;
        }))
      ends[0].fd = -1;
    if (ends[1].revents != 0 && !drain(err, [&](std::string_view bytes) { listener.take(bytes); }))
      ends[1].fd = -1;
  }
}

}  // namespace

ComparisonProgramEnd run_comparison_program(const std::filesystem::path& program,
                                            const std::vector<std::string>& arguments,
                                            const std::string& input, const crypto::AgeIdentities& identities,
                                            const ComparisonProgramProgress& progress,
                                            const std::atomic<bool>& stop) {
  std::vector<std::string> all{program.string(), "compare", "--identity-socket",
                               std::to_string(kIdentitySocket)};
  all.insert(all.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& each : all) pointers.push_back(each.data());
  pointers.push_back(nullptr);

  Pair out = make_pipe(), err = make_pipe(), socket = make_socket();
  std::optional<Given> given(
      Given{file_of(input), std::move(out.theirs), std::move(err.theirs), std::move(socket.theirs)});
  const pid_t parent = ::getpid(), child = ::fork();
  if (child < 0) fail("no process");
  if (child == 0) become(all.front().c_str(), pointers.data(), *given, parent);
  given.reset();
  ComparisonProgramEnd end;
  Listener listener(progress);
  {
    std::jthread answering([&] { crypto::answer_for(identities, socket.ours.number()); });
    listen_until_end(child, out.ours.number(), err.ours.number(), end, listener, stop);
    ::shutdown(socket.ours.number(), SHUT_RDWR);
  }
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  end.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  end.problem = listener.problem();
  if (end.status == kNotStarted && end.problem.empty())
    end.problem = "the program " + program.string() + " cannot be started; install Kiroku anew";
  return end;
}

}  // namespace kiroku::viewer
