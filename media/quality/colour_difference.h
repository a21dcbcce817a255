// How far apart colours look. Functions are pure and thread-safe; objects belong to one thread.
#pragma once

#include <array>
#include <cstdint>

#include "media/png.h"

namespace kiroku::media {

/// CIE 1976 L*a*b*.
struct Lab {
  double lightness = 0, a = 0, b = 0;
};
/// Of an sRGB colour under its own white, D65 (IEC 61966-2-1).
Lab lab_of(std::uint8_t red, std::uint8_t green, std::uint8_t blue);

/// CIEDE2000, all three weights 1 (CIE 142-2001), as in Sharma, Wu and Dalal, Color Research and Application
/// 30(1), 2005. About 1 can just be told apart side by side.
double ciede2000(const Lab& one, const Lab& other);

/// Colour differences of all pixels of pictures.
class ColourError {
 public:
  /// Both of red, green and blue, and of one size; kiroku::Error for others.
  void add(const PictureView& one, const PictureView& other);
  /// Of all pixels so far; 0 without any.
  [[nodiscard]] double mean() const;
  /// What `share` of the pixels do not exceed, rounded up to 0.01.
  [[nodiscard]] double quantile(double share) const;

 private:
  static constexpr std::size_t kSteps = 10'001;  // of 0.01; the last holds all above
  std::array<std::uint64_t, kSteps> counts_{};
  std::uint64_t pixels_ = 0;
  double sum_ = 0;
};

}  // namespace kiroku::media
