#include "recorder/source/file_input.h"

#include <cerrno>
#include <fcntl.h>
#include <new>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

extern "C" {
#include <libavformat/avformat.h>
#include <libavutil/error.h>
#include <libavutil/mem.h>
}

#include "base/error.h"

namespace kiroku::recorder {
namespace {

// As libavformat's own reading of files.
constexpr int kBufferBytes = 32 * 1024;

}  // namespace

FileInput::FileInput(const std::string& path, std::function<bool()> must_stop)
    : descriptor_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)), must_stop_(std::move(must_stop)) {
  if (!descriptor_) throw IoError("open the film", path, errno);
  auto* buffer = static_cast<unsigned char*>(av_malloc(kBufferBytes));
  io_.reset(buffer == nullptr ? nullptr
                              : avio_alloc_context(buffer, kBufferBytes, 0, this, &FileInput::read, nullptr,
                                                   &FileInput::seek));
  if (!io_) {
    av_free(buffer);
    throw std::bad_alloc();
  }
}

int FileInput::read(void* self, unsigned char* bytes, int size) {
  const FileInput& file = *static_cast<FileInput*>(self);
  for (;;) {
    if (file.must_stop_()) return AVERROR_EXIT;
    const ssize_t got = ::read(file.descriptor_.number(), bytes, static_cast<std::size_t>(size));
    if (got > 0) return static_cast<int>(got);
    if (got == 0) return AVERROR_EOF;
    if (errno != EINTR) return AVERROR(errno);
  }
}

std::int64_t FileInput::seek(void* self, std::int64_t offset, int whence) {
  const int file = static_cast<FileInput*>(self)->descriptor_.number();
  if ((whence & AVSEEK_SIZE) != 0) {
    struct stat known {};
    return ::fstat(file, &known) == 0 ? known.st_size : AVERROR(errno);
  }
  const off_t at = ::lseek(file, offset, whence & ~AVSEEK_FORCE);
  return at < 0 ? AVERROR(errno) : at;
}

}  // namespace kiroku::recorder
