#include "apps/kirokud/successor.h"

#include <cerrno>
#include <csignal>
#include <fcntl.h>
#include <spawn.h>
#include <string_view>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <utility>

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kPatience{30};
constexpr std::chrono::seconds kAskAgain{10};
constexpr std::string_view kDeleted = " (deleted)";

}  // namespace

std::string Successor::own_file_of_process() {
  std::error_code ignored;
  return fs::read_symlink("/proc/self/exe", ignored).string();
}

Successor::Successor(std::vector<std::string> arguments, Questions questions, const Clock& clock)
    : arguments_(std::move(arguments)), questions_(std::move(questions)), clock_(&clock) {
  std::string file = questions_.own_file();
  if (file.ends_with(kDeleted)) file.resize(file.size() - kDeleted.size());
  program_ = std::move(file);
}

Successor::~Successor() { end_child(); }

std::optional<Successor::Identity> Successor::candidate() const {
  if (!questions_.own_file().ends_with(kDeleted)) return {};
  struct stat found {};
  // While a package is unpacked there may be no program for a moment.
  if (::stat(program_.c_str(), &found) != 0) return {};
  return Identity{static_cast<std::int64_t>(found.st_dev), static_cast<std::int64_t>(found.st_ino),
                  static_cast<std::int64_t>(found.st_size), static_cast<std::int64_t>(found.st_ctim.tv_sec),
                  static_cast<std::int64_t>(found.st_ctim.tv_nsec)};
}

bool Successor::look(bool of_now) {
  const std::optional<Identity> found = candidate();
  if (!found) return false;
  if (found != candidate_) {
    end_child();
    taken_ = refused_ = false;
    candidate_ = found;
  }
  const Clock::Time now = clock_->now();
  const bool is_of_now = now - asked_ <= kPatience;
  if (child_ == 0) {
    if (taken_ && (is_of_now || !of_now)) return true;
    if (refused_ && now - asked_ < kAskAgain) return false;
    ask();
    if (child_ == 0) refuse(" --check cannot be started");
    return false;
  }
  std::optional<int> status = answer();
  if (!status && !is_of_now) {
    end_child();
    status = -1;
  }
  if (!status) return false;
  if (*status != 0) {
    refuse(" --check does not take the configuration");
    return false;
  }
  taken_ = true;
  refused_ = false;
  return is_of_now || !of_now;
}

void Successor::refuse(const std::string& why) {
  if (!refused_ && questions_.tell)
    questions_.tell("a newer version was installed, and " + program_.string() + why +
                    ": this one goes on recording; mend that, and the newer one takes over by itself");
  refused_ = true;
  taken_ = false;
}

// What it says goes to the journal, once.
void Successor::ask() {
  asked_ = clock_->now();
  std::string name = program_.string();
  std::vector<std::string> texts = arguments_;
  std::vector<char*> arguments{name.data()};
  for (std::string& text : texts) arguments.push_back(text.data());
  arguments.push_back(nullptr);
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  sigset_t none;
  ::sigemptyset(&none);
  ::posix_spawnattr_setsigmask(&attributes, &none);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  posix_spawn_file_actions_t files;
  ::posix_spawn_file_actions_init(&files);
  for (const int output : {STDOUT_FILENO, STDERR_FILENO}) {
    if (refused_) ::posix_spawn_file_actions_addopen(&files, output, "/dev/null", O_WRONLY, 0);
  }
  pid_t child = 0;
  if (::posix_spawn(&child, name.c_str(), &files, &attributes, arguments.data(), environ) == 0)
    child_ = child;
  ::posix_spawn_file_actions_destroy(&files);
  ::posix_spawnattr_destroy(&attributes);
}

std::optional<int> Successor::answer() {
  int status = 0;
  const pid_t ended = ::waitpid(child_, &status, WNOHANG);
  if (ended == 0 || (ended < 0 && errno == EINTR)) return {};
  child_ = 0;
  return ended > 0 && WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

void Successor::end_child() {
  if (child_ == 0) return;
  ::kill(child_, SIGKILL);
  ::waitpid(child_, nullptr, 0);
  child_ = 0;
}

}  // namespace kiroku::apps
