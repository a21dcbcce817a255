#include "apps/kiroku/serving.h"

#include <csignal>
#include <filesystem>
#include <memory>
#include <mutex>
#include <sys/resource.h>
#include <utility>

#include "apps/common/command_line.h"

namespace kiroku::apps {
namespace {

/// A thousand connections need more descriptors than a shell gives.
void allow_many_descriptors() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  ::setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace

std::function<void(const std::string&)> tell_on_standard_error() {
  return [mutex = std::make_shared<std::mutex>()](const std::string& sentence) {
    const std::lock_guard guard(*mutex);
    print_error("kiroku", sentence);
  };
}

void serve_until_stopped(
    viewer::ViewerOptions options, const Home& home,
    const std::function<void(const viewer::Viewer& server, const std::string& sign_in)>& started) {
  allow_many_descriptors();
  std::error_code ignored;
  const bool is_demonstration =
      std::filesystem::exists(home.identity_file(), ignored) && viewer::is_loopback(options.web.listen);
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  // The server's threads inherit the mask, so that the signals wait for this one.
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  viewer::Viewer server(std::move(options));
  started(server, is_demonstration ? server.sign_in_url("demo") : "");
  int number = 0;
  sigwait(&signals, &number);
  // A second signal does not wait for what is being verified, sent or broken off.
  ::pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
}

}  // namespace kiroku::apps
