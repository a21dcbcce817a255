#include "base/process_hardening.h"

#include <sys/prctl.h>
#include <sys/resource.h>

namespace kiroku {
namespace {

#if defined(__SANITIZE_ADDRESS__)
constexpr bool kLooksForLeaks = true;
#elif defined(__has_feature)
constexpr bool kLooksForLeaks = __has_feature(address_sanitizer);
#else
constexpr bool kLooksForLeaks = false;
#endif

}  // namespace

void harden_process() {
  const rlimit no_core{0, 0};
  (void)::setrlimit(RLIMIT_CORE, &no_core);
  (void)::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  if (!kLooksForLeaks) (void)::prctl(PR_SET_DUMPABLE, 0, 0, 0, 0);
}

}  // namespace kiroku
