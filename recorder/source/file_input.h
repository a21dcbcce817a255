// A file as a libav input that needs no path once it is open. An object belongs to one thread.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "base/descriptor.h"
#include "media/libav_handles.h"

namespace kiroku::recorder {

class FileInput {
 public:
  /// `must_stop` is asked before each reading: where it says so, reading ends with AVERROR_EXIT. Throws
  /// kiroku::IoError.
  FileInput(const std::string& path, std::function<bool()> must_stop);
  ~FileInput() = default;
  FileInput(const FileInput&) = delete;
  FileInput& operator=(const FileInput&) = delete;

  /// Belongs to the object, which must outlive whatever reads from it.
  [[nodiscard]] AVIOContext* context() const { return io_.get(); }

 private:
  static int read(void* self, unsigned char* bytes, int size);
  static std::int64_t seek(void* self, std::int64_t offset, int whence);

  Descriptor descriptor_;
  std::function<bool()> must_stop_;
  media::CustomIo io_;
};

}  // namespace kiroku::recorder
