// A V4L2 camera for a machine that has none: loaded before the C library (LD_PRELOAD), it answers what a
// program asks of one character device, so that libavdevice's own code captures from it. Environment:
//   KIROKU_CAMERA_DEVICE    the device whose calls are answered; it must exist and may be any (/dev/full)
//   KIROKU_CAMERA_GIVEN     a file of eight zeros in which it counts the pictures that it gave, to whichever
//   process KIROKU_CAMERA_PICTURES  so many pictures come, 20 a second; then none ever again
//   KIROKU_CAMERA_THEN      what happens then: "silent" (a program that waits in the driver waits for ever,
//   one
//                           that may not is told to come again), "stuck" (the driver keeps whoever asks for a
//                           picture), "stuck-closing" (silent, and the driver keeps whoever ends the stream)
// It offers pictures of 64x48 in YUYV, whatever is asked for. The program's decoders, which get no
// environment (media/box/child.h), get this one: they are who opens the camera.

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdarg>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <spawn.h>
#include <string>
#include <string_view>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <thread>
#include <unistd.h>
#include <vector>

namespace {

using Clock = std::chrono::steady_clock;

constexpr unsigned kWidth = 64, kHeight = 48, kBytes = 2 * kWidth * kHeight, kMostBuffers = 32;
constexpr std::chrono::milliseconds kInterval{50};

std::string setting(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

/// The device, open once at a time.
struct Camera {
  std::atomic<int> descriptor = -1;
  std::atomic<bool> may_wait = true;
  Clock::time_point due;
  std::array<bool, kMostBuffers> queued{};
  unsigned buffers = 0, sequence = 0;
};
Camera& camera() {
  static Camera the_camera;
  return the_camera;
}

/// Of all processes, as each opening of a source is one.
std::atomic<int>& given() {
  static std::atomic<int>* const counted = [] {
    const int file = ::open(setting("KIROKU_CAMERA_GIVEN").c_str(), O_RDWR | O_CLOEXEC);
    void* const at =
        file < 0 ? MAP_FAILED
                 : ::mmap(nullptr, sizeof(std::atomic<int>), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (at == MAP_FAILED) std::abort();
    ::close(file);
    return static_cast<std::atomic<int>*>(at);
  }();
  return *counted;
}

template <typename Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));  // NOLINT(*-reinterpret-cast)
}

/// As in a call that does not come back.
void wait_for_ever() {
  for (;;) std::this_thread::sleep_for(std::chrono::hours(1));
}

int fail(int error) {
  errno = error;
  return -1;
}

int take_picture(v4l2_buffer& buffer) {
  Camera& it = camera();
  if (given() >= std::atoi(setting("KIROKU_CAMERA_PICTURES").c_str())) {
    if (setting("KIROKU_CAMERA_THEN") == "stuck" || it.may_wait) wait_for_ever();
    return fail(EAGAIN);
  }
  if (Clock::now() < it.due) {
    if (!it.may_wait) return fail(EAGAIN);
    std::this_thread::sleep_until(it.due);
  }
  for (unsigned i = 0; i < it.buffers; ++i) {
    if (!it.queued[i]) continue;
    it.queued[i] = false;
    it.due = Clock::now() + kInterval;
    ++given();
    buffer.index = i;
    buffer.bytesused = buffer.length = kBytes;
    buffer.sequence = it.sequence++;
    buffer.flags = V4L2_BUF_FLAG_MAPPED | V4L2_BUF_FLAG_DONE | V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    const auto now = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now().time_since_epoch());
    buffer.timestamp = {static_cast<time_t>(now.count() / 1'000'000),
                        static_cast<suseconds_t>(now.count() % 1'000'000)};
    return 0;
  }
  return fail(EAGAIN);
}

int answer(unsigned long asked, void* what) {
  Camera& it = camera();
  switch (asked) {
    case VIDIOC_QUERYCAP: {
      auto& capability = *static_cast<v4l2_capability*>(what);
      capability = {};
      std::strcpy(reinterpret_cast<char*>(capability.driver), "played");       // NOLINT
      std::strcpy(reinterpret_cast<char*>(capability.card), "played camera");  // NOLINT
      capability.device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
      capability.capabilities = capability.device_caps | V4L2_CAP_DEVICE_CAPS;
      return 0;
    }
    case VIDIOC_G_INPUT:
    case VIDIOC_S_INPUT:
      *static_cast<int*>(what) = 0;
      return 0;
    case VIDIOC_ENUMINPUT: {
      auto& input = *static_cast<v4l2_input*>(what);
      if (input.index > 0) return fail(EINVAL);
      input = {};
      input.type = V4L2_INPUT_TYPE_CAMERA;
      return 0;
    }
    case VIDIOC_ENUM_FMT: {
      auto& format = *static_cast<v4l2_fmtdesc*>(what);
      if (format.index > 0) return fail(EINVAL);
      format.pixelformat = V4L2_PIX_FMT_YUYV;
      return 0;
    }
    case VIDIOC_G_FMT:
    case VIDIOC_S_FMT:
    case VIDIOC_TRY_FMT: {
      auto& format = static_cast<v4l2_format*>(what)->fmt.pix;
      format.width = kWidth;
      format.height = kHeight;
      format.pixelformat = V4L2_PIX_FMT_YUYV;
      format.field = V4L2_FIELD_NONE;
      format.bytesperline = 2 * kWidth;
      format.sizeimage = kBytes;
      return 0;
    }
    case VIDIOC_G_PARM:
    case VIDIOC_S_PARM: {
      auto& capture = static_cast<v4l2_streamparm*>(what)->parm.capture;
      capture.capability = V4L2_CAP_TIMEPERFRAME;
      capture.timeperframe = {1, 20};
      return 0;
    }
    case VIDIOC_REQBUFS: {
      auto& request = *static_cast<v4l2_requestbuffers*>(what);
      it.buffers = request.count = std::min(request.count, kMostBuffers);
      return 0;
    }
    case VIDIOC_QUERYBUF: {
      auto& buffer = *static_cast<v4l2_buffer*>(what);
      buffer.length = kBytes;
      buffer.m.offset = 0;
      return 0;
    }
    case VIDIOC_QBUF:
      it.queued.at(static_cast<v4l2_buffer*>(what)->index) = true;
      return 0;
    case VIDIOC_DQBUF:
      return take_picture(*static_cast<v4l2_buffer*>(what));
    case VIDIOC_STREAMON:
      it.due = Clock::now() + kInterval;
      return 0;
    case VIDIOC_STREAMOFF:
      if (setting("KIROKU_CAMERA_THEN") == "stuck-closing") wait_for_ever();
      return 0;
    default:
      return fail(ENOTTY);
  }
}

int open_camera(int flags) {
  (void)given();  // no file can be opened later: the decoder's box is closed then
  const int descriptor = ::memfd_create("camera", MFD_CLOEXEC);
  if (descriptor < 0) return -1;
  camera().queued = {};
  camera().may_wait = (flags & O_NONBLOCK) == 0;
  camera().descriptor = descriptor;
  return descriptor;
}

int open_as(const char* function, const char* path, int flags, mode_t mode) {
  if (path == setting("KIROKU_CAMERA_DEVICE")) return open_camera(flags);
  return next<int (*)(const char*, int, ...)>(function)(path, flags, mode);
}

mode_t mode_of(int flags, va_list arguments) {
  return (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : 0;
}

}  // namespace

extern "C" {

int posix_spawn(pid_t* process, const char* program, const posix_spawn_file_actions_t* actions,
                const posix_spawnattr_t* attributes, char* const arguments[],
                char* const variables[]) noexcept {
  std::vector<char*> all;
  for (; *variables != nullptr; ++variables) all.push_back(*variables);
  for (char** each = environ; *each != nullptr; ++each) {
    const std::string_view variable = *each;
    if (variable.starts_with("KIROKU_CAMERA_") || variable.starts_with("LD_PRELOAD=")) all.push_back(*each);
  }
  all.push_back(nullptr);
  return next<decltype(&posix_spawn)>("posix_spawn")(process, program, actions, attributes, arguments,
                                                     all.data());
}
int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_as("open", path, flags, mode);
}
int open64(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_as("open64", path, flags, mode);
}
/// The device's own memory. A decoder may make no file long enough for it.
void* mmap(void* at, size_t bytes, int protection, int flags, int descriptor, off_t offset) noexcept {
  if (descriptor >= 0 && descriptor == camera().descriptor) {
    descriptor = -1;
    flags = MAP_PRIVATE | MAP_ANONYMOUS;
    offset = 0;
  }
  return next<decltype(&mmap)>("mmap")(at, bytes, protection, flags, descriptor, offset);
}
void* mmap64(void* at, size_t bytes, int protection, int flags, int descriptor, off64_t offset) noexcept {
  return mmap(at, bytes, protection, flags, descriptor, offset);
}
int close(int descriptor) {
  int expected = descriptor;
  if (descriptor >= 0) camera().descriptor.compare_exchange_strong(expected, -1);
  return next<int (*)(int)>("close")(descriptor);
}
int ioctl(int descriptor, unsigned long asked, ...) noexcept {
  va_list arguments;
  va_start(arguments, asked);
  void* what = va_arg(arguments, void*);
  va_end(arguments);
  if (descriptor >= 0 && descriptor == camera().descriptor) return answer(static_cast<unsigned>(asked), what);
  return next<int (*)(int, unsigned long, ...)>("ioctl")(descriptor, asked, what);
}

}  // extern "C"
