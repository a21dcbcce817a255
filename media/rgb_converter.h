// Decoded pictures as sRGB samples, for showing and comparing.
#pragma once

#include <cstdint>
#include <vector>

#include "media/libav_handles.h"

namespace kiroku::media {

/// Pictures of changing formats as sRGB samples (height x width x 3), rows from the top. The same picture
/// gives the same bytes on every processor. Not thread-safe.
class RgbConverter {
 public:
  /// `width` and `height` of the result: bicubic where they are not the picture's own; 0: its own. Colours
  /// are taken as the picture says; where it does not, as BT.709 from 720 lines on, else BT.601. Throws
  /// kiroku::Error for formats that swscale does not know.
  std::vector<std::uint8_t> convert(const AVFrame& frame, int width = 0, int height = 0);

 private:
  Scaler scaler_;
};

}  // namespace kiroku::media
