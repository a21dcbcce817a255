#include "media/rgb_converter.h"

#include <algorithm>
#include <cstddef>
#include <string>

extern "C" {
#include <libswscale/swscale.h>

#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
}

#include "base/error.h"

namespace kiroku::media {

std::vector<std::uint8_t> RgbConverter::convert(const AVFrame& frame, int width, int height) {
  constexpr int kChannels = 3, kFirstHdLines = 720, kUnchanged = 1 << 16;
  if (width == 0) width = frame.width;
  if (height == 0) height = frame.height;
  const auto format = static_cast<AVPixelFormat>(frame.format);
  // Without the exact flags swscale's results depend on the processor.
  constexpr int kFlags = SWS_BICUBIC | SWS_ACCURATE_RND | SWS_BITEXACT | SWS_FULL_CHR_H_INT;
  scaler_.reset(sws_getCachedContext(scaler_.release(), frame.width, frame.height, format, width, height,
                                     AV_PIX_FMT_RGB24, kFlags, nullptr, nullptr, nullptr));
  if (!scaler_) {
    const char* const name = av_get_pix_fmt_name(format);
    throw Error(std::string("pictures of the format ") + (name != nullptr ? name : "(unknown)") +
                " cannot be shown: swscale does not know it");
  }
  const bool hd = frame.colorspace == AVCOL_SPC_BT709 ||
                  (frame.colorspace == AVCOL_SPC_UNSPECIFIED && frame.height >= kFirstHdLines);
  const int* const colours = sws_getCoefficients(hd ? SWS_CS_ITU709 : SWS_CS_ITU601);
  const int full_range = frame.color_range == AVCOL_RANGE_JPEG ? 1 : 0;
  sws_setColorspaceDetails(scaler_.get(), colours, full_range, colours, 1, 0, kUnchanged, kUnchanged);
  // Rows of swscale's own choice: it may write beyond the end of one.
  const Frame wide = make_frame();
  wide->width = width;
  wide->height = height;
  wide->format = AV_PIX_FMT_RGB24;
  require(av_frame_get_buffer(wide.get(), 0), "cannot convert a picture");
  require(sws_scale(scaler_.get(), frame.data, frame.linesize, 0, frame.height, wide->data, wide->linesize),
          "cannot convert a picture");
  const std::ptrdiff_t row = std::ptrdiff_t{kChannels} * width;
  std::vector<std::uint8_t> rgb(static_cast<std::size_t>(row * height));
  for (int y = 0; y < height; ++y)
    std::copy_n(wide->data[0] + std::ptrdiff_t{y} * wide->linesize[0], row, rgb.data() + y * row);
  return rgb;
}

}  // namespace kiroku::media
