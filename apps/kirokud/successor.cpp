#include "apps/kirokud/successor.h"

#include <cerrno>
#include <csignal>
#include <fcntl.h>
#include <spawn.h>
#include <string_view>
#include <sys/wait.h>
#include <unistd.h>
#include <utility>

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kPatience{30};
constexpr std::chrono::seconds kAskAgain{10};
constexpr std::string_view kDeleted = " (deleted)";

std::string own_file() {
  std::error_code ignored;
  return fs::read_symlink("/proc/self/exe", ignored).string();
}

}  // namespace

Successor::Successor(std::vector<std::string> arguments,
                     std::function<void(const std::string& sentence)> tell)
    : arguments_(std::move(arguments)), tell_(std::move(tell)) {
  std::string file = own_file();
  if (file.ends_with(kDeleted)) file.resize(file.size() - kDeleted.size());
  program_ = std::move(file);
}

Successor::~Successor() { end_child(); }

bool Successor::is_ready() {
  std::error_code ignored;
  // While a package is unpacked there may be no program for a moment.
  if (!own_file().ends_with(kDeleted) || !fs::exists(program_, ignored)) return false;
  const auto now = std::chrono::steady_clock::now();
  if (child_ == 0) {
    if (refused_ && now - asked_ < kAskAgain) return false;
    ask();
    if (child_ == 0) refuse(" --check cannot be started");
    return false;
  }
  const bool is_of_now = now - asked_ <= kPatience;
  std::optional<int> status = answer();
  if (!status && !is_of_now) {
    end_child();
    status = -1;
  }
  // What was answered long ago, while a case ran, is asked again: the configuration may be another by now.
  if (status == 0) return is_of_now;
  if (status) refuse(" --check does not take the configuration");
  return false;
}

void Successor::refuse(const std::string& why) {
  if (!refused_ && tell_)
    tell_("a newer version was installed, and " + program_.string() + why +
          ": this one goes on recording; mend that, and the newer one takes over by itself");
  refused_ = true;
}

// What it says goes to the journal, once.
void Successor::ask() {
  asked_ = std::chrono::steady_clock::now();
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
