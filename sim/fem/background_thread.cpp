#include "sim/fem/background_thread.h"

#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

namespace kiroku::sim {

bool work_in_background() {
  constexpr int kNiceness = 10;
  const sched_param none{};
  if (::pthread_setschedparam(::pthread_self(), SCHED_BATCH, &none) != 0) return false;
  // On Linux a thread has a niceness of its own.
  return ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNiceness) == 0;
}

}  // namespace kiroku::sim
