#include "sim/render/picture_jpeg.h"

#include <memory>
#include <string>
#include <turbojpeg.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

struct CompressorDeleter {
  void operator()(void* compressor) const { tjDestroy(compressor); }
};
using Compressor = std::unique_ptr<void, CompressorDeleter>;

}  // namespace

Bytes jpeg_of(const Picture& picture, int quality) {
  if (picture.width < 1 || picture.height < 1) throw Error("a picture without pixels is no JPEG file");
  const Compressor compressor(tjInitCompress());
  if (compressor == nullptr) throw Error(std::string("cannot begin a JPEG file: ") + tjGetErrorStr());
  Bytes file(tjBufSize(picture.width, picture.height, TJSAMP_420));
  auto* into = reinterpret_cast<unsigned char*>(file.data());
  unsigned long size = file.size();
  if (tjCompress2(compressor.get(), picture.rgb.data(), picture.width, 0, picture.height, TJPF_RGB, &into,
                  &size, TJSAMP_420, quality, TJFLAG_NOREALLOC) != 0) {
    throw Error(std::string("cannot make a JPEG file: ") + tjGetErrorStr2(compressor.get()));
  }
  file.resize(size);
  return file;
}

}  // namespace kiroku::sim
