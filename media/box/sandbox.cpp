#include "media/box/sandbox.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <fcntl.h>
#include <initializer_list>
#include <malloc.h>
#include <memory>
#include <sched.h>
#include <seccomp.h>
#include <string>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/error.h"
#include "media/box/child.h"

namespace kiroku::media {
namespace {

constexpr bool kSanitized = !std::string_view(KIROKU_SANITIZERS).empty();
constexpr rlim_t kMostDescriptors = 64;
constexpr rlim_t kMostAddresses = rlim_t{4} << 30;
/// Each of the C library's arenas sets 64 MiB of addresses aside, and it makes eight for each processor.
constexpr int kMostArenas = 8;

[[noreturn]] void fail(const std::string& what, int error) {
  throw Error("a decoder cannot be boxed here: " + what + ": " + std::strerror(error));
}

void limit(__rlimit_resource which, rlim_t most, const char* what) {
  rlimit now{};
  (void)::getrlimit(which, &now);
  const rlimit wanted{std::min(most, now.rlim_max), std::min(most, now.rlim_max)};
  if (::setrlimit(which, &wanted) != 0) fail(std::string("no limit of ") + what, errno);
}

/// What becomes of a call that is not on the list.
constexpr std::uint32_t kOtherwise = kSanitized ? SCMP_ACT_ERRNO(EPERM) : SCMP_ACT_KILL_PROCESS;

class Filter {
 public:
  Filter() : context_(::seccomp_init(kOtherwise)) {
    if (!context_) fail("no filter of system calls", ENOSYS);
    // Libraries start threads before main().
    check(::seccomp_attr_set(context_.get(), SCMP_FLTATR_CTL_TSYNC, 1));
    check(::seccomp_attr_set(context_.get(), SCMP_FLTATR_ACT_BADARCH, SCMP_ACT_KILL_PROCESS));
  }
  void allow(std::initializer_list<const char*> calls) { rule(SCMP_ACT_ALLOW, calls); }
  void refuse(std::initializer_list<const char*> calls, unsigned error) {
    rule(SCMP_ACT_ERRNO(error), calls);
  }
  void allow_if(const char* call, scmp_arg_cmp condition) { add(SCMP_ACT_ALLOW, call, &condition, 1); }
  void refuse_if(const char* call, unsigned error, scmp_arg_cmp condition) {
    add(SCMP_ACT_ERRNO(error), call, &condition, 1);
  }
  void load() { check(::seccomp_load(context_.get())); }

 private:
  struct Release {
    void operator()(void* context) const { ::seccomp_release(context); }
  };
  static void check(int result) {
    if (result < 0) fail("no filter of system calls", -result);
  }
  void rule(std::uint32_t action, std::initializer_list<const char*> calls) {
    for (const char* call : calls) add(action, call, nullptr, 0);
  }
  void add(std::uint32_t action, const char* call, const scmp_arg_cmp* condition, unsigned conditions) {
    if (action == kOtherwise) return;  // libseccomp takes no rule that says what holds anyway
    const int number = ::seccomp_syscall_resolve_name(call);
    // One that this processor, or this libseccomp, does not know is not on the list then.
    if (number == __NR_SCMP_ERROR) return;
    check(::seccomp_rule_add_array(context_.get(), action, number, conditions, condition));
  }

  std::unique_ptr<void, Release> context_;
};

scmp_arg_cmp equal(unsigned argument, std::uint64_t value) { return {argument, SCMP_CMP_EQ, value, 0}; }
scmp_arg_cmp masked(unsigned argument, std::uint64_t mask, std::uint64_t value) {
  return {argument, SCMP_CMP_MASKED_EQ, mask, value};
}

/// Memory, threads, clocks, and descriptors that are there.
void allow_common(Filter& filter) {
  filter.allow({"read",
                "write",
                "readv",
                "writev",
                "pread64",
                "lseek",
                "close",
                "munmap",
                "mremap",
                "madvise",
                "brk",
                "futex",
                "set_robust_list",
                "rseq",
                "rt_sigaction",
                "rt_sigprocmask",
                "rt_sigreturn",
                "sigaltstack",
                "exit",
                "exit_group",
                "sched_yield",
                "sched_getaffinity",
                "getpid",
                "gettid",
                "clock_gettime",
                "clock_getres",
                "clock_nanosleep",
                "nanosleep",
                "gettimeofday",
                "time",
                "poll",
                "ppoll",
                "select",
                "pselect6",
                "getrandom",
                "fstat",
                "uname",
                "sysinfo",
                "getcpu",
                "restart_syscall",
                "membarrier",
                "getrusage",
                "getuid",
                "geteuid",
                "getgid",
                "getegid"});
  // Memory is never executable, so that no code comes in as data.
  if (kSanitized) {
    filter.allow({"mmap", "mprotect", "readlink", "sched_getparam", "sched_getscheduler", "clone", "clone3",
                  "tgkill", "pipe2", "dup", "dup2", "sched_setaffinity"});
  } else {
    filter.allow_if("mmap", masked(2, PROT_EXEC, 0));
    filter.allow_if("mprotect", masked(2, PROT_EXEC, 0));
    // Threads of its own, and no process. clone3()'s flags lie in memory, where no filter sees them; the C
    // library then takes clone().
    filter.refuse({"clone3"}, ENOSYS);
    constexpr std::uint64_t kThread = CLONE_VM | CLONE_THREAD | CLONE_SIGHAND;
    filter.allow_if("clone", masked(0, kThread, kThread));
    // To itself alone: abort().
    filter.allow_if("tgkill", equal(0, static_cast<std::uint64_t>(::getpid())));
  }
  filter.allow_if("prctl", equal(0, PR_SET_NAME));
  filter.allow_if("prctl", equal(0, PR_GET_NAME));  // libsrt
  filter.allow_if("fcntl", equal(1, F_GETFL));
  filter.allow_if("fcntl", equal(1, F_SETFL));
  filter.allow_if("fcntl", equal(1, F_GETFD));
  filter.allow_if("fcntl", equal(1, F_SETFD));
  // Its limits may be read, not set.
  filter.allow_if("prlimit64", equal(2, 0));
  // fstat() of the C library.
  filter.allow_if("newfstatat", equal(3, AT_EMPTY_PATH));
  // The channel: a connected socket, to no address.
  filter.allow_if("sendto", equal(4, 0));
  filter.allow({"recvfrom", "shutdown"});
  // What libraries look for and can do without.
  filter.refuse({"open", "openat", "openat2", "creat", "access", "faccessat", "faccessat2", "stat", "lstat",
                 "statx", "statfs", "readlinkat", "getdents64", "getcwd"},
                EACCES);
  if (!kSanitized) filter.refuse({"readlink"}, EACCES);
  filter.refuse_if("newfstatat", EACCES, equal(3, 0));
  filter.refuse_if("newfstatat", EACCES, equal(3, AT_SYMLINK_NOFOLLOW));
  filter.refuse({"mlock", "munlock", "mbind", "set_mempolicy", "get_mempolicy", "sched_setscheduler",
                 "sched_setparam", "setpriority", "ioprio_set"},
                EPERM);
}

void allow_network(Filter& filter) {
  filter.allow_if("socket", equal(0, AF_INET));
  filter.allow_if("socket", equal(0, AF_INET6));
  // Among the refused: netlink, by which the C library would list interfaces, and local sockets.
  filter.refuse_if("socket", EACCES, equal(0, AF_NETLINK));
  filter.refuse_if("socket", EACCES, equal(0, AF_UNIX));
  filter.allow({"connect", "bind", "getsockname", "getpeername", "setsockopt", "getsockopt", "sendmsg",
                "recvmsg", "sendmmsg", "recvmmsg", "epoll_create", "epoll_create1", "epoll_ctl", "epoll_wait",
                "epoll_pwait", "eventfd2"});
  filter.allow_if("sendto", {4, SCMP_CMP_NE, 0, 0});
  constexpr std::uint64_t kCommand = 0xffff'ffff;
  filter.allow_if("ioctl", masked(1, kCommand, 0x5421));  // FIONBIO
  filter.allow_if("ioctl", masked(1, kCommand, 0x541B));  // FIONREAD
}

/// Else no other program's port is taken in its place, as that of monitors while nobody waits there.
void allow_connections(Filter& filter) { filter.allow({"listen", "accept", "accept4"}); }

/// V4L2's calls have 'V' as their type (ioctl(2), linux/videodev2.h).
void allow_device(Filter& filter) { filter.allow_if("ioctl", masked(1, 0xff00, std::uint64_t{'V'} << 8)); }

/// A recorder asks to be the last that the kernel ends for want of memory (OOMScoreAdjust= of its unit), and
/// what it starts inherits that. Its decoders come before it.
void come_before_the_recorder() {
  constexpr std::string_view kNoPreference = "0";
  const Descriptor preference(::open("/proc/self/oom_score_adj", O_RDWR | O_CLOEXEC));
  char sign = 0;
  if (preference && ::pread(preference.number(), &sign, 1, 0) == 1 && sign == '-')
    (void)!::write(preference.number(), kNoPreference.data(), kNoPreference.size());
}

}  // namespace

void limit_process(unsigned processor_seconds) {
  come_before_the_recorder();
  (void)::signal(SIGPIPE, SIG_IGN);
  (void)::prctl(PR_SET_NAME, "kiroku-decoder");
  if (::close_range(kMemoryDescriptor + 1, ~0U, 0) != 0) fail("descriptors stay open", errno);
  limit(RLIMIT_CORE, 0, "core files");
  limit(RLIMIT_FSIZE, 0, "file sizes");
  limit(RLIMIT_MEMLOCK, 0, "locked memory");
  limit(RLIMIT_NOFILE, kMostDescriptors, "descriptors");
  if (processor_seconds > 0) limit(RLIMIT_CPU, processor_seconds, "processor time");
  (void)::mallopt(M_ARENA_MAX, kMostArenas);
  // A sanitizer's shadow takes terabytes of addresses.
  if (!kSanitized) limit(RLIMIT_AS, kMostAddresses, "memory");
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) fail("new privileges cannot be refused", errno);
  if (::prctl(PR_SET_DUMPABLE, 0, 0, 0, 0) != 0) fail("it stays open to others", errno);
}

void close_box(BoxNeeds needs) {
  Filter filter;
  allow_common(filter);
  if (needs == BoxNeeds::kNetwork || needs == BoxNeeds::kServer) allow_network(filter);
  if (needs == BoxNeeds::kServer) allow_connections(filter);
  if (needs == BoxNeeds::kDevice) allow_device(filter);
  filter.load();
}

}  // namespace kiroku::media
