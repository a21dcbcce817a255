// One channel of a picture as numbers, and smoothing it. Pure functions, thread-safe.
#pragma once

#include <cstddef>
#include <vector>

struct AVFrame;

namespace kiroku::media {

/// Rows from the top, without gaps between them. Luma is in units of 8 bits (0 to 255) whatever its depth.
struct Plane {
  int width = 0, height = 0;
  std::vector<float> samples;
  [[nodiscard]] float at(int x, int y) const {
    return samples[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                   static_cast<std::size_t>(x)];
  }
};

/// The luma of a planar picture of 8 to 16 bits. Throws kiroku::Error for other pixel formats.
Plane luma_of(const AVFrame& picture);

/// A sampled Gaussian of 2 * `radius` + 1 taps whose sum is 1; `sigma` in pixels.
std::vector<float> gaussian_taps(double sigma, int radius);
/// Rows, then columns, by the same taps, of which there is an odd number. Only where the taps lie within the
/// plane: the result is smaller. Throws kiroku::Error for a plane smaller than the taps.
Plane filtered_within(const Plane& plane, const std::vector<float>& taps);
/// The same size, mirrored at its sides; a Gaussian cut off at four `sigma`.
Plane blurred(const Plane& plane, double sigma);

}  // namespace kiroku::media
