// Pictures in memory, and as PNG files. Functions are pure and thread-safe.
#pragma once

#include <cstdint>
#include <span>

#include "base/bytes.h"

namespace kiroku::media {

/// A picture that somebody else holds: rows from the top, without gaps between them.
struct PictureView {
  int width = 0, height = 0;
  int channels = 3;                       // 3: red, green, blue (sRGB); 1: grey
  std::span<const std::uint8_t> samples;  // (height x width x channels)
};
/// Throws kiroku::Error for a picture without pixels, of other channels, or whose samples are of another
/// count.
void require_valid(const PictureView& picture);

/// What a file's making is for: to be kept, or to be looked at once and at once.
enum class PngEffort { kSmall, kQuick };

/// A PNG file of the picture, the same bytes each time. Throws kiroku::Error as require_valid().
Bytes png_of(const PictureView& picture, PngEffort effort = PngEffort::kSmall);

}  // namespace kiroku::media
