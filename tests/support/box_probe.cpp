// Tries to get out of a box: closes it as the decoder does, then makes one call.
//   box_probe nothing|network|server|device CALL
// Exit status: 0 the call was done, 10 the kernel refused it, 3 there is no such call here; a call that is
// not on the list ends the process by SIGSYS. "self" tells what the process has become, on standard output.

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <functional>
#include <map>
#include <sched.h>
#include <string>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

#include "media/box/sandbox.h"

namespace {

pid_t parent = 0;
char secret[16];

long try_read_of_parent() {
  iovec here{secret, sizeof secret};
  iovec there{reinterpret_cast<void*>(0x400000), sizeof secret};  // NOLINT
  return ::process_vm_readv(parent, &here, 1, &there, 1, 0);
}

long try_thread() {
  bool ran = false;
  std::thread([&] { ran = true; }).join();
  return ran ? 0 : -1;
}

long try_executable_memory() {
  return ::mmap(nullptr, 4096, PROT_READ | PROT_WRITE | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) ==
                 MAP_FAILED
             ? -1
             : 0;
}

long try_to_make_executable() {
  void* const page = ::mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  return ::mprotect(page, 4096, PROT_READ | PROT_EXEC);
}

long try_much_memory() {
  void* const much = std::malloc(std::size_t{5} << 30);
  if (much == nullptr) return -1;
  std::free(much);
  return 0;
}

long try_limit() {
  const rlimit much{RLIM_INFINITY, RLIM_INFINITY};
  return ::setrlimit(RLIMIT_AS, &much);
}

long try_program() {
  char* const arguments[] = {nullptr};
  return ::execve("/bin/true", arguments, arguments);
}

const std::map<std::string, std::function<long()>>& calls() {
  static const std::map<std::string, std::function<long()>> all{
      {"open", [] { return ::open("/etc/passwd", O_RDONLY); }},
      {"create", [] { return ::open("/tmp/kiroku-box-probe", O_WRONLY | O_CREAT | O_CLOEXEC, 0600); }},
      {"memory of parent",
       [] { return ::open(("/proc/" + std::to_string(parent) + "/mem").c_str(), O_RDONLY); }},
      {"read of parent", try_read_of_parent},
      {"ptrace", [] { return ::ptrace(PTRACE_ATTACH, parent, nullptr, nullptr); }},
      {"signal", [] { return ::kill(parent, 0); }},
      {"descriptor of parent",
       [] { return ::syscall(SYS_pidfd_getfd, ::syscall(SYS_pidfd_open, parent, 0), 0, 0); }},
      {"program", try_program},
      {"process", [] { return ::syscall(SYS_fork); }},
      {"vfork", [] { return ::syscall(SYS_vfork); }},
      {"clone3", [] { return ::syscall(SYS_clone3, nullptr, 0); }},
      {"new process by clone",
       [] { return ::syscall(SYS_clone, SIGCHLD, nullptr, nullptr, nullptr, nullptr); }},
      {"namespace", [] { return ::unshare(CLONE_NEWUSER); }},
      {"mount", [] { return ::mount("none", "/mnt", "tmpfs", 0, nullptr); }},
      {"unlink", [] { return ::unlink("/tmp/kiroku-box-probe"); }},
      {"mkdir", [] { return ::mkdir("/tmp/kiroku-box-probe-folder", 0700); }},
      {"chmod", [] { return ::chmod("/tmp", 01777); }},
      {"socket", [] { return ::socket(AF_INET, SOCK_STREAM, 0); }},
      {"waiting for connections", [] { return ::listen(::socket(AF_INET, SOCK_STREAM, 0), 1); }},
      {"local socket", [] { return ::socket(AF_UNIX, SOCK_STREAM, 0); }},
      {"netlink", [] { return ::socket(AF_NETLINK, SOCK_RAW, 0); }},
      {"raw socket", [] { return ::socket(AF_PACKET, SOCK_RAW, 0); }},
      {"executable memory", try_executable_memory},
      {"making memory executable", try_to_make_executable},
      {"much memory", try_much_memory},
      {"limit", try_limit},
      {"dumpable", [] { return ::prctl(PR_SET_DUMPABLE, 1, 0, 0, 0); }},
      {"another filter", [] { return ::prctl(PR_SET_SECCOMP, 1, 0, 0, 0); }},
      {"bpf", [] { return ::syscall(SYS_bpf, 0, nullptr, 0); }},
      {"perf", [] { return ::syscall(SYS_perf_event_open, nullptr, 0, -1, -1, 0); }},
      {"io_uring", [] { return ::syscall(SYS_io_uring_setup, 1, nullptr); }},
      {"userfaultfd", [] { return ::syscall(SYS_userfaultfd, 0); }},
      {"keys", [] { return ::syscall(SYS_keyctl, 0, 0, 0, 0, 0); }},
      {"terminal", [] { return ::ioctl(0, TIOCSTI, "x"); }},
      {"uid", [] { return ::setuid(0); }},
      {"thread", try_thread},
      {"memory", [] { return std::malloc(1 << 20) == nullptr ? -1L : 0L; }},
      {"clock", [] { return ::usleep(1000); }},
      {"name of its thread",
       [] {
         char name[16];
         return ::prctl(PR_GET_NAME, name);
       }},
  };
  return all;
}

int tell_of_self() {
  rlimit core{1, 1};
  (void)::getrlimit(RLIMIT_CORE, &core);
  std::printf("no_new_privs %d dumpable %d core %ld\n", ::prctl(PR_GET_NO_NEW_PRIVS, 0, 0, 0, 0),
              ::prctl(PR_GET_DUMPABLE, 0, 0, 0, 0), static_cast<long>(core.rlim_cur));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  using kiroku::media::BoxNeeds;
  const std::string needs = argv[1], name = argv[2];
  parent = ::getppid();
  kiroku::media::limit_process(60);
  if (name == "self") return tell_of_self();
  const auto found = calls().find(name);
  if (found == calls().end()) return 2;
  kiroku::media::close_box(needs == "network"  ? BoxNeeds::kNetwork
                           : needs == "server" ? BoxNeeds::kServer
                           : needs == "device" ? BoxNeeds::kDevice
                                               : BoxNeeds::kNothing);
  errno = 0;
  const long result = found->second();
  if (result >= 0) ::_exit(0);
  ::_exit(errno == ENOSYS && name != "clone3" ? 3 : 10);
}
