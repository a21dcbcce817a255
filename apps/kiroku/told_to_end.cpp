#include "apps/kiroku/told_to_end.h"

#include <atomic>
#include <csignal>

namespace kiroku::apps {
namespace {

std::atomic<bool> told = false;
static_assert(std::atomic<bool>::is_always_lock_free);

}  // namespace

void end_when_told() {
  struct sigaction action {};
  action.sa_handler = [](int) { told = true; };
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ::sigaction(signal, &action, nullptr);
}

bool told_to_end() { return told; }

}  // namespace kiroku::apps
