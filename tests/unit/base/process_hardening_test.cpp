#include "base/process_hardening.h"

#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <gtest/gtest.h>

namespace kiroku {
namespace {

TEST(ProcessHardening, LeavesNoCoreAndNothingToAttachTo) {
  const pid_t child = ::fork();
  if (child == 0) {
    harden_process();
    rlimit core{1, 1};
    const bool no_core = ::getrlimit(RLIMIT_CORE, &core) == 0 && core.rlim_cur == 0 && core.rlim_max == 0;
    const bool no_new = ::prctl(PR_GET_NO_NEW_PRIVS, 0, 0, 0, 0) == 1;
#if defined(__SANITIZE_ADDRESS__)
    const bool closed = true;
#elif defined(__clang__)
    const bool closed = __has_feature(address_sanitizer) || ::prctl(PR_GET_DUMPABLE, 0, 0, 0, 0) == 0;
#else
    const bool closed = ::prctl(PR_GET_DUMPABLE, 0, 0, 0, 0) == 0;
#endif
    ::_exit((no_core ? 0 : 1) + (no_new ? 0 : 2) + (closed ? 0 : 4));
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

}  // namespace
}  // namespace kiroku
