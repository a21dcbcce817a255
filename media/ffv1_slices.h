// How many parts FFV1 (RFC 9043, 4.9) codes a picture in.
#pragma once

namespace kiroku::media {

/// Four where libavcodec's encoder takes no less, which is above 352 x 288, and where parts are worth
/// their own coder states; else one. Coded bytes depend on it.
constexpr const char* ffv1_slices(int width, int height) {
  const bool must = width > 352 || height > 288;
  return must || (width >= 64 && height >= 64) ? "4" : "1";
}

}  // namespace kiroku::media
