// A named pipe as libav input that can be interrupted: opening or reading a FIFO through libav itself blocks
// without asking its interrupt callback. One thread, but for the function given.
#pragma once

#include <functional>
#include <string>

#include "media/libav_handles.h"

namespace kiroku::recorder {

class FifoInput {
 public:
  /// Opens `path` for reading without waiting for a writer. `must_stop` is asked about ten times a second
  /// while nothing comes. Throws kiroku::IoError.
  FifoInput(const std::string& path, std::function<bool()> must_stop);
  ~FifoInput();
  FifoInput(const FifoInput&) = delete;
  FifoInput& operator=(const FifoInput&) = delete;

  /// For AVFormatContext::pb; owned by this object, which must outlive the format context. Reading waits for
  /// the first writer; when the last one has closed the pipe, that is the end.
  [[nodiscard]] AVIOContext* context() const { return io_.get(); }

 private:
  static int read(void* self, unsigned char* bytes, int size);
  int read(unsigned char* bytes, int size);

  int descriptor_;
  std::function<bool()> must_stop_;
  bool had_writer_ = false;
  media::CustomIo io_;
};

}  // namespace kiroku::recorder
