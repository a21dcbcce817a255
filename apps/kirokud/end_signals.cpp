#include "apps/kirokud/end_signals.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/error.h"

namespace kiroku::apps {

EndSignals::EndSignals() {
  descriptor_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (descriptor_ < 0) throw Error("signals cannot be received");
  struct sigaction end {};
  end.sa_handler = [](int signal) {
    number_ = signal;
    constexpr std::uint64_t kOne = 1;
    (void)!::write(descriptor_, &kOne, sizeof kOne);
  };
  end.sa_flags = SA_RESTART;
  sigset_t wanted;
  ::sigemptyset(&wanted);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    ::sigaddset(&wanted, signal);
    ::sigaction(signal, &end, nullptr);
  }
  ::pthread_sigmask(SIG_BLOCK, &wanted, &before_);
  ::signal(SIGPIPE, SIG_IGN);
}

int EndSignals::wait(std::chrono::seconds limit) const {
  pollfd waiting{descriptor_, POLLIN, 0};
  const timespec time{limit.count(), 0};
  ::ppoll(&waiting, 1, &time, &before_);
  return number_;
}

}  // namespace kiroku::apps
