#include "media/box/child.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <ctime>
#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>
#include <utility>

#include "base/error.h"
#include "base/printable.h"
#include "media/box/sandbox.h"

namespace kiroku::media {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

constexpr const char* kNothing = "/dev/null";
// Above all numbers that the child's descriptors get, so that none is written over before it was copied.
constexpr int kFirstFree = 16;
constexpr std::size_t kProbeBytes = 4096;
/// A process is started and its libraries loaded meanwhile, also on a machine that is busy.
constexpr milliseconds kProbing{30'000}, kProbeStep{100};

[[noreturn]] void fail(const std::string& what, int error) {
  throw IoError("start the decoder,", what, error);
}

Descriptor moved_up(int descriptor) {
  Descriptor copy(::fcntl(descriptor, F_DUPFD_CLOEXEC, kFirstFree));
  if (!copy) fail("kiroku-decoder", errno);
  return copy;
}

/// What a process is begun with; freed when it goes.
struct Beginning {
  Beginning() {
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawnattr_init(&attributes);
  }
  ~Beginning() {
    ::posix_spawn_file_actions_destroy(&actions);
    ::posix_spawnattr_destroy(&attributes);
  }
  Beginning(const Beginning&) = delete;
  Beginning& operator=(const Beginning&) = delete;
  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
};

}  // namespace

fs::path find_decoder_program() {
  std::error_code failed;
  const fs::path here = fs::read_symlink("/proc/self/exe", failed).parent_path();
  // Beside; from bin; from a folder of tests in a build.
  for (const char* candidate :
       {"kiroku-decoder", "../libexec/kiroku/kiroku-decoder", "../../apps/kiroku-decoder"}) {
    fs::path program = (here / candidate).lexically_normal();
    if (::access(program.c_str(), X_OK) == 0) return program;
  }
  return {};
}

Descriptor make_shared_memory(std::size_t bytes) {
  Descriptor memory(::memfd_create("kiroku-decoder", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (!memory || ::ftruncate(memory.number(), static_cast<off_t>(bytes)) != 0 ||
      // Whoever shortened it could end the other process by SIGBUS.
      ::fcntl(memory.number(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0) {
    throw IoError("make", "memory to share with the decoder", errno);
  }
  return memory;
}

Mapping::Mapping(int descriptor, std::size_t bytes, int protection, std::size_t offset) : size_(bytes) {
  void* const at = ::mmap(nullptr, bytes, protection, MAP_SHARED, descriptor, static_cast<off_t>(offset));
  if (at == MAP_FAILED) throw IoError("map", "memory that is shared with the decoder", errno);
  data_ = static_cast<std::byte*>(at);
}
Mapping::~Mapping() {
  if (data_ != nullptr) ::munmap(data_, size_);
}
Mapping::Mapping(Mapping&& other) noexcept
    : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}
Mapping& Mapping::operator=(Mapping&& other) noexcept {
  std::swap(data_, other.data_);
  std::swap(size_, other.size_);
  return *this;
}

namespace {

/// The program as it was when it was needed first: an upgrade while a case is recorded may replace it by one
/// that this process does not understand.
int program_at_hand() {
  static const Descriptor program = [] {
    const fs::path found = find_decoder_program();
    if (found.empty()) fail("kiroku-decoder (it belongs to this program; install Kiroku anew)", ENOENT);
    Descriptor opened(::open(found.c_str(), O_PATH | O_CLOEXEC));
    if (!opened) fail(found.string(), errno);
    return opened;
  }();
  return program.number();
}

}  // namespace

BoxedChild::Started BoxedChild::start(const std::string& role, const Descriptor& memory) {
  const Descriptor executable = moved_up(program_at_hand());
  const std::string program = "/proc/self/fd/" + std::to_string(executable.number());
  SocketPair pair = make_channel_pair();
  const Descriptor theirs = moved_up(pair.theirs.number());
  const Descriptor shared = moved_up(memory.number());

  Beginning beginning;
  for (const int standard : {STDIN_FILENO, STDOUT_FILENO}) {
    ::posix_spawn_file_actions_addopen(&beginning.actions, standard, kNothing, O_RDWR, 0);
  }
  // A sanitizer speaks there; a decoder has nothing to say to a terminal or a journal.
  if (std::string_view(KIROKU_SANITIZERS).empty())
    ::posix_spawn_file_actions_addopen(&beginning.actions, STDERR_FILENO, kNothing, O_RDWR, 0);
  ::posix_spawn_file_actions_adddup2(&beginning.actions, theirs.number(), kChannelDescriptor);
  ::posix_spawn_file_actions_adddup2(&beginning.actions, shared.number(), kMemoryDescriptor);
  // All others close when the program begins, or are closed by it (limit_process()).
  sigset_t none, all;
  sigemptyset(&none);
  sigfillset(&all);
  ::posix_spawnattr_setsigmask(&beginning.attributes, &none);
  ::posix_spawnattr_setsigdefault(&beginning.attributes, &all);
  // A group of its own: Ctrl-C on a terminal ends the recorder, which then ends its decoders.
  ::posix_spawnattr_setpgroup(&beginning.attributes, 0);
  ::posix_spawnattr_setflags(&beginning.attributes,
                             POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  std::array<std::string, 2> arguments{"kiroku-decoder", role};
  std::array<char*, 3> pointers{arguments[0].data(), arguments[1].data(), nullptr};
  // OpenBLAS, which FFmpeg's filters stand on, would start threads that have nothing to do.
  std::string blas = "OPENBLAS_NUM_THREADS=1";
  std::array<char*, 2> environment{blas.data(), nullptr};
  pid_t process = -1;
  const int failed = ::posix_spawn(&process, program.c_str(), &beginning.actions, &beginning.attributes,
                                   pointers.data(), environment.data());
  if (failed != 0) fail("kiroku-decoder", failed);
  return {process, std::move(pair.ours)};
}

BoxedChild::BoxedChild(const std::string& role, const Descriptor& memory)
    : started_(start(role, memory)),
      process_(started_.process),
      watched_(static_cast<int>(::syscall(SYS_pidfd_open, process_, 0))),
      channel_(std::move(started_.socket)) {}

BoxedChild::~BoxedChild() { end(); }

bool BoxedChild::reap(bool wait) {
  if (status_) return true;
  int status = 0;
  pid_t ended = 0;
  while ((ended = ::waitpid(process_, &status, wait ? 0 : WNOHANG)) < 0 && errno == EINTR) {
  }
  if (ended == 0) return false;
  status_ = ended < 0 ? 0 : status;
  return true;
}

void BoxedChild::end(std::chrono::milliseconds patience) {
  if (status_) return;
  channel_.shut_down();
  if (watched_ && patience.count() > 0 && !reap(false)) {
    pollfd ended{watched_.number(), POLLIN, 0};
    (void)::poll(&ended, 1, static_cast<int>(patience.count()));
  }
  if (reap(false)) return;
  killed_ = true;
  // Until it was waited for, its number is nobody else's.
  (void)::kill(process_, SIGKILL);
  reap(true);
}

std::string BoxedChild::how_it_ended(std::chrono::milliseconds patience) {
  end(patience);
  if (killed_) return "does not answer";
  const int status = status_.value_or(0);
  if (!WIFSIGNALED(status)) return "ended with status " + std::to_string(WEXITSTATUS(status));
  const int signal = WTERMSIG(status);
  const char* const name = ::sigabbrev_np(signal);
  std::string text = "was killed by SIG" + std::string(name == nullptr ? std::to_string(signal) : name);
  if (signal == SIGSYS) text += ", as it asked for what it may not";
  if (signal == SIGXCPU) text += ", as it took too long";
  return text;
}

bool BoxedChild::killed_from_outside() const {
  return !killed_ && status_ && WIFSIGNALED(*status_) && WTERMSIG(*status_) == SIGKILL;
}

std::chrono::nanoseconds BoxedChild::processor_time() const {
  clockid_t clock{};
  timespec time{};
  if (status_ || ::clock_getcpuclockid(process_, &clock) != 0 || ::clock_gettime(clock, &time) != 0)
    return {};
  return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

std::string why_no_box(const std::function<void()>& waiting) {
  try {
    const Descriptor memory = make_shared_memory(kProbeBytes);
    BoxedChild child("probe", memory);
    try {
      for (milliseconds waited{0}; waited < kProbing; waited += kProbeStep) {
        if (const auto answer = child.channel().receive(kProbeStep, kProbeBytes))
          return printable(text_of(answer->body));
        if (waiting) waiting();
      }
    } catch (const ChannelError&) {
    }
    return "the decoder " + child.how_it_ended();
  } catch (const Error& error) {
    return error.what();
  }
}

void run_box_probe() {
  Channel channel{Descriptor(kChannelDescriptor)};
  try {
    std::string failure;
    try {
      limit_process(0);
      close_box(BoxNeeds::kNetwork);
    } catch (const Error& error) {
      failure = error.what();
    }
    channel.send(0, failure);
  } catch (const ChannelError&) {  // nobody waits for the answer any more
  }
  ::_exit(0);
}

}  // namespace kiroku::media
