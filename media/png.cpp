#include "media/png.h"

#include <cstring>

extern "C" {
#include <libavcodec/avcodec.h>
}

#include "media/libav_handles.h"

namespace kiroku::media {

void require_valid(const PictureView& picture) {
  if (picture.width <= 0 || picture.height <= 0 || (picture.channels != 1 && picture.channels != 3)) {
    throw Error("a picture of " + std::to_string(picture.width) + "x" + std::to_string(picture.height) +
                " pixels and " + std::to_string(picture.channels) +
                " channels cannot be written: it must have pixels, of one channel or of three");
  }
  const std::size_t expected = static_cast<std::size_t>(picture.width) *
                               static_cast<std::size_t>(picture.height) *
                               static_cast<std::size_t>(picture.channels);
  if (picture.samples.size() != expected) {
    throw Error("a picture of " + std::to_string(expected) + " samples was given " +
                std::to_string(picture.samples.size()));
  }
}

Bytes png_of(const PictureView& picture, PngEffort effort) {
  require_valid(picture);
  silence_libav();
  const AVCodec* const codec = avcodec_find_encoder(AV_CODEC_ID_PNG);
  if (codec == nullptr) {
    throw Error("this libavcodec cannot encode PNG; install Debian's FFmpeg libraries");
  }
  const Codec encoder(avcodec_alloc_context3(codec));
  const Frame frame = make_frame();
  if (!encoder) throw std::bad_alloc();
  const AVPixelFormat format = picture.channels == 1 ? AV_PIX_FMT_GRAY8 : AV_PIX_FMT_RGB24;
  encoder->width = frame->width = picture.width;
  encoder->height = frame->height = picture.height;
  encoder->pix_fmt = format;
  frame->format = format;
  encoder->time_base = {1, 1};
  encoder->flags |= static_cast<int>(AV_CODEC_FLAG_BITEXACT);
  if (effort == PngEffort::kQuick) encoder->compression_level = 1;
  require(avcodec_open2(encoder.get(), codec, nullptr), "cannot begin a PNG picture");
  require(av_frame_get_buffer(frame.get(), 0), "cannot begin a PNG picture");
  const auto row = static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.channels);
  for (int y = 0; y < picture.height; ++y) {
    std::memcpy(frame->data[0] + std::ptrdiff_t{y} * frame->linesize[0],
                picture.samples.data() + static_cast<std::size_t>(y) * row, row);
  }
  const Packet packet = make_packet();
  require(avcodec_send_frame(encoder.get(), frame.get()), "cannot encode a PNG picture");
  require(avcodec_receive_packet(encoder.get(), packet.get()), "cannot encode a PNG picture");
  const auto bytes = std::as_bytes(std::span(packet->data, static_cast<std::size_t>(packet->size)));
  return {bytes.begin(), bytes.end()};
}

}  // namespace kiroku::media
