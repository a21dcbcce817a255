// A film of smooth pictures that move and use all values of full range, as many cameras give them: 4:2:0, 25
// a second, coded without loss by the recorder's own encoder.
#pragma once

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/pixfmt.h>
}

#include "recorder/encoder/segment_muxer.h"
#include "recorder/encoder/video_encoder.h"

namespace kiroku::test {

/// In Matroska; `profile` is kLossless or kUncompressed.
inline void write_full_range_film(const std::filesystem::path& file, int width, int height, int pictures,
                                  recorder::Profile profile = recorder::Profile::kLossless) {
  recorder::PictureFormat format;
  format.width = width;
  format.height = height;
  format.pixel_format = AV_PIX_FMT_YUV420P;
  format.sample_aspect = {1, 1};
  format.colour_range = AVCOL_RANGE_JPEG;
  format.colour_space = AVCOL_SPC_BT709;
  recorder::VideoProfile video;
  video.profile = profile;
  recorder::VideoEncoder encoder(format, {25, 1}, video);
  const std::unique_ptr<recorder::SegmentMuxer> muxer = recorder::make_matroska_muxer();
  std::ofstream output(file, std::ios::binary);
  muxer->begin({encoder.muxed_stream()}, [&output](ByteView bytes) {
    output.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  });
  constexpr std::int64_t kIntervalNs = 40'000'000;
  for (int n = 0; n < pictures; ++n) {
    media::Frame frame = media::make_frame();
    frame->format = format.pixel_format;
    frame->width = width;
    frame->height = height;
    frame->color_range = AVCOL_RANGE_JPEG;
    frame->colorspace = AVCOL_SPC_BT709;
    media::require(av_frame_get_buffer(frame.get(), 0), "cannot make a test picture");
    for (int plane = 0; plane < 3; ++plane) {
      const int side = plane == 0 ? 1 : 2;
      for (int y = 0; y < height / side; ++y) {
        for (int x = 0; x < width / side; ++x) {
          const double wave = std::sin(0.05 * (side * x + 2 * n)) * std::cos(0.07 * side * y);
          frame->data[plane][y * frame->linesize[plane] + x] =
              static_cast<std::uint8_t>(std::lround(127.5 + (plane == 0 ? 127.5 : 60) * wave));
        }
      }
    }
    media::Packet packet = encoder.encode(encoder.prepare(std::move(frame), n * kIntervalNs), n == 0);
    muxer->write(std::move(packet), 0);
  }
  muxer->end();
}

}  // namespace kiroku::test
