#include "media/output_io.h"

#include <new>
#include <span>

extern "C" {
#include <libavformat/avio.h>
#include <libavutil/error.h>
#include <libavutil/mem.h>
}

namespace kiroku::media {

OutputIo::OutputIo(OutputBytes& output) : output_(output) {
  constexpr int kBufferBytes = 1 << 18;
  auto* const buffer = static_cast<unsigned char*>(av_malloc(kBufferBytes));
  if (buffer == nullptr) {
    throw std::bad_alloc();
  }
  // The bytes are const from libavformat 61 on.
  const auto taken = [](void* self, auto* bytes, int size) { return write(self, bytes, size); };
  context_.reset(avio_alloc_context(buffer, kBufferBytes, 1, this, nullptr, taken, seek));
  if (!context_) {
    av_free(buffer);
    throw std::bad_alloc();
  }
}

void OutputIo::check(int result, const std::string& what) const {
  if (failure_) {
    std::rethrow_exception(failure_);
  }
  require(result, what);
}

void OutputIo::flush(const std::string& what) const {
  avio_flush(context_.get());
  check(context_->error, what);
}

int OutputIo::write(void* self, const std::uint8_t* bytes, int size) {
  auto& io = *static_cast<OutputIo*>(self);
  if (io.failure_) {
    return AVERROR(EIO);
  }
  try {
    io.output_.write(std::as_bytes(std::span(bytes, static_cast<std::size_t>(size))));
    return size;
  } catch (...) {
    io.failure_ = std::current_exception();
    return AVERROR(EIO);
  }
}

std::int64_t OutputIo::seek(void* self, std::int64_t offset, int whence) {
  auto& io = *static_cast<OutputIo*>(self);
  if ((whence & ~AVSEEK_FORCE) == AVSEEK_SIZE) {
    return static_cast<std::int64_t>(io.output_.size());
  }
  if ((whence & ~AVSEEK_FORCE) != SEEK_SET || offset < 0) {
    return AVERROR(EINVAL);
  }
  io.output_.seek(static_cast<std::uint64_t>(offset));
  return offset;
}

}  // namespace kiroku::media
