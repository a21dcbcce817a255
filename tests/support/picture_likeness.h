// How alike two pictures of one size are.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "sim/render/picture.h"

namespace kiroku::test {

struct PictureLikeness {
  int largest = 0;   // difference of a sample, of 255
  double share = 0;  // of the samples that differ by more than `allowed`
  double ssim = 1;
};

/// SSIM is the mean over all windows of 8 x 8 pixels of the luma (Wang et al., "Image Quality Assessment:
/// From Error Visibility to Structural Similarity", IEEE Transactions on Image Processing 13(4), 2004).
inline PictureLikeness likeness(const sim::Picture& one, const sim::Picture& other, int allowed = 2) {
  PictureLikeness found;
  std::size_t differing = 0;
  for (std::size_t i = 0; i < one.rgb.size(); ++i) {
    const int by = std::abs(int{one.rgb[i]} - int{other.rgb[i]});
    found.largest = std::max(found.largest, by);
    differing += by > allowed ? 1 : 0;
  }
  found.share = double(differing) / double(one.rgb.size());
  constexpr int kWindow = 8;
  const auto luma = [](const std::uint8_t* rgb) { return 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2]; };
  double sum = 0, windows = 0;
  for (int y = 0; y + kWindow <= one.height; ++y) {
    for (int x = 0; x + kWindow <= one.width; ++x) {
      double a = 0, b = 0, aa = 0, bb = 0, ab = 0;
      for (int dy = 0; dy < kWindow; ++dy) {
        for (int dx = 0; dx < kWindow; ++dx) {
          const double p = luma(one.pixel(x + dx, y + dy)), q = luma(other.pixel(x + dx, y + dy));
          a += p;
          b += q;
          aa += p * p;
          bb += q * q;
          ab += p * q;
        }
      }
      constexpr double kCount = kWindow * kWindow, kC1 = 6.5025, kC2 = 58.5225;
      a /= kCount;
      b /= kCount;
      const double variance_a = aa / kCount - a * a, variance_b = bb / kCount - b * b;
      const double covariance = ab / kCount - a * b;
      sum += (2 * a * b + kC1) * (2 * covariance + kC2) /
             ((a * a + b * b + kC1) * (variance_a + variance_b + kC2));
      ++windows;
    }
  }
  if (windows > 0) found.ssim = sum / windows;
  return found;
}

}  // namespace kiroku::test
