#include "recorder/source/v4l2_format.h"

#include <dlfcn.h>
#include <string>

extern "C" {
#include <libavdevice/version.h>
#include <libavformat/avformat.h>
#include <libavutil/macros.h>
}

#include "base/error.h"

namespace kiroku::recorder {
namespace {

const AVInputFormat* load() {
  // Of the version whose header says how it is used. It stays loaded: libavformat lists its formats from then
  // on.
  constexpr const char* kLibrary = "libavdevice.so." AV_STRINGIFY(LIBAVDEVICE_VERSION_MAJOR);
  void* const library = ::dlopen(kLibrary, RTLD_NOW | RTLD_LOCAL);
  void* const entry = library != nullptr ? ::dlsym(library, "avdevice_register_all") : nullptr;
  if (entry == nullptr) {
    const char* const why = ::dlerror();
    throw Error(
        std::string("no camera can be opened: ") + (why != nullptr ? why : kLibrary) +
        "; install FFmpeg's libavdevice (Debian: libavdevice" AV_STRINGIFY(LIBAVDEVICE_VERSION_MAJOR) ")");
  }
  reinterpret_cast<void (*)()>(entry)();
  const AVInputFormat* const format = av_find_input_format("video4linux2");
  if (format == nullptr)
    throw Error(std::string("no camera can be opened: this ") + kLibrary + " has no V4L2");
  return format;
}

}  // namespace

const AVInputFormat* v4l2_input_format() {
  static const AVInputFormat* const format = load();
  return format;
}

}  // namespace kiroku::recorder
