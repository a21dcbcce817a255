#include "recorder/source/fifo_input.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

extern "C" {
#include <libavformat/avio.h>
#include <libavutil/error.h>
#include <libavutil/mem.h>
}

#include <cerrno>
#include <chrono>
#include <thread>
#include <utility>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

constexpr int kBufferBytes = 1 << 20;
constexpr int kPatienceMs = 100;

}  // namespace

FifoInput::FifoInput(const std::string& path, std::function<bool()> must_stop)
    : descriptor_(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)), must_stop_(std::move(must_stop)) {
  if (descriptor_ < 0) throw IoError("open the pipe", path, errno);
  auto* buffer = static_cast<unsigned char*>(av_malloc(kBufferBytes));
  io_.reset(buffer == nullptr
                ? nullptr
                : avio_alloc_context(buffer, kBufferBytes, 0, this, &FifoInput::read, nullptr, nullptr));
  if (!io_) {
    av_free(buffer);
    ::close(descriptor_);
    throw std::bad_alloc();
  }
  io_->seekable = 0;
}

FifoInput::~FifoInput() { ::close(descriptor_); }

int FifoInput::read(void* self, unsigned char* bytes, int size) {
  return static_cast<FifoInput*>(self)->read(bytes, size);
}

int FifoInput::read(unsigned char* bytes, int size) {
  while (!must_stop_()) {
    pollfd ready{descriptor_, POLLIN, 0};
    const int polled = ::poll(&ready, 1, kPatienceMs);
    if (polled < 0 && errno != EINTR) return AVERROR(errno);
    if (polled <= 0) continue;
    const ssize_t got = ::read(descriptor_, bytes, static_cast<std::size_t>(size));
    if (got > 0) {
      had_writer_ = true;
      return static_cast<int>(got);
    }
    if (got < 0 && errno != EAGAIN && errno != EINTR) return AVERROR(errno);
    if (got == 0 && had_writer_) return AVERROR_EOF;
    // Nobody has opened the other end yet: the kernel reports "end" at once, so this waits by itself.
    if (got == 0) std::this_thread::sleep_for(std::chrono::milliseconds(kPatienceMs / 10));
  }
  return AVERROR_EXIT;
}

}  // namespace kiroku::recorder
