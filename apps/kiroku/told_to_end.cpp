#include "apps/kiroku/told_to_end.h"

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <poll.h>
#include <string>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/error.h"

namespace kiroku::apps {
namespace {

std::atomic<bool> told = false;
std::atomic<int> waker = -1;  // an eventfd: readable once it is told
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free);

void hear(int /*signal*/) {
  const int before = errno;
  const std::uint64_t one = 1;
  told = true;
  static_cast<void>(!::write(waker, &one, sizeof one));
  errno = before;
}

}  // namespace

void end_when_told() {
  if (waker < 0) waker = ::eventfd(0, EFD_CLOEXEC);
  if (waker < 0) throw Error(std::string("cannot wait for signals: ") + std::strerror(errno));
  struct sigaction action {};
  action.sa_handler = hear;
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_RESTART);
  for (const int signal : {SIGINT, SIGTERM}) ::sigaction(signal, &action, nullptr);
  struct sigaction of_hangup {};
  ::sigaction(SIGHUP, nullptr, &of_hangup);
  if (of_hangup.sa_handler != SIG_IGN) ::sigaction(SIGHUP, &action, nullptr);  // nohup(1)
}

bool told_to_end() { return told; }

void wait_until_told() {
  std::uint64_t count = 0;
  while (!told && (::read(waker, &count, sizeof count) >= 0 || errno == EINTR)) {
  }
}

bool wait_until_told(std::chrono::milliseconds pause) {
  const auto end = std::chrono::steady_clock::now() + pause;
  while (!told) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    if (left.count() <= 0) break;
    pollfd heard{waker, POLLIN, 0};
    // Interrupted, it looks again.
    static_cast<void>(!::poll(&heard, 1, static_cast<int>(left.count())));
  }
  return told;
}

}  // namespace kiroku::apps
