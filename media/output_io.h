// What libav's muxers write, into OutputBytes. An object belongs to one thread.
#pragma once

#include <cstdint>
#include <exception>
#include <string>

#include "media/libav_handles.h"
#include "media/output_file.h"

namespace kiroku::media {

/// Where libav's callbacks land. An exception may not pass through libav's C code, so it waits until check().
class OutputIo {
 public:
  /// `output` must outlive the object; the object whatever writes to context().
  explicit OutputIo(OutputBytes& output);
  OutputIo(const OutputIo&) = delete;
  OutputIo& operator=(const OutputIo&) = delete;

  [[nodiscard]] AVIOContext* context() const { return context_.get(); }
  /// Throws what the file threw in a callback meanwhile, else as require(result, what).
  void check(int result, const std::string& what) const;
  /// Hands what is buffered to the file; throws as check().
  void flush(const std::string& what) const;

 private:
  static int write(void* self, const std::uint8_t* bytes, int size);
  static std::int64_t seek(void* self, std::int64_t offset, int whence);

  OutputBytes& output_;
  std::exception_ptr failure_;
  CustomIo context_;
};

}  // namespace kiroku::media
