// A V4L2 camera for a machine that has none: loaded before the C library (LD_PRELOAD), it answers what a
// program asks of one character device, so that libavdevice's own code captures from it. Environment:
//   KIROKU_CAMERA_DEVICE    the device whose calls are answered; it must exist and may be any (/dev/full)
//   KIROKU_CAMERA_PICTURES  so many pictures come, 20 a second; then none ever again
//   KIROKU_CAMERA_THEN      what happens then: "silent" (a program that waits in the driver waits for ever,
//   one
//                           that may not is told to come again), "stuck" (the driver keeps whoever asks for a
//                           picture), "stuck-closing" (silent, and the driver keeps whoever ends the stream)
// It offers pictures of 64x48 in YUYV, whatever is asked for.

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
#include <string>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <thread>
#include <unistd.h>

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
  std::atomic<int> given = 0;  // since the program began
  Clock::time_point due;
  std::array<bool, kMostBuffers> queued{};
  unsigned buffers = 0, sequence = 0;
};
Camera& camera() {
  static Camera the_camera;
  return the_camera;
}

template <typename Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));  // NOLINT(*-reinterpret-cast)
}

/// Waits in a call that nothing ends.
void wait_for_ever() {
  std::array<int, 2> ends{};
  if (::pipe(ends.data()) != 0) std::abort();
  char byte = 0;
  (void)!::read(ends[0], &byte, 1);
}

int fail(int error) {
  errno = error;
  return -1;
}

int take_picture(v4l2_buffer& buffer) {
  Camera& it = camera();
  if (it.given >= std::atoi(setting("KIROKU_CAMERA_PICTURES").c_str())) {
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
    ++it.given;
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
  const int descriptor = ::memfd_create("camera", MFD_CLOEXEC);
  if (descriptor < 0 || ::ftruncate(descriptor, kBytes) != 0) return -1;
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
