// A computed picture. Plain data.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace kiroku::sim {

using Rgb = std::array<std::uint8_t, 3>;

struct Picture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  // (height x width x 3), rows from the top; sRGB

  Picture() = default;
  Picture(int wide, int high)
      : width(wide), height(high), rgb(static_cast<std::size_t>(wide) * static_cast<std::size_t>(high) * 3) {}
  /// (0, 0) is the pixel in the left upper corner.
  [[nodiscard]] std::uint8_t* pixel(int x, int y) {
    return rgb.data() +
           3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x));
  }
  [[nodiscard]] const std::uint8_t* pixel(int x, int y) const {
    return rgb.data() +
           3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x));
  }
};

}  // namespace kiroku::sim
