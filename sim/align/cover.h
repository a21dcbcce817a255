// Which pixels show no tissue: instruments, smoke, what shines, cloth and gloves. They may lie before the
// organ, so they say neither that it is there nor that it is not. Plain data; functions are pure and
// thread-safe.
//
// Source: tissue is reddish and instruments are grey, as Doignon, Graebling and de Mathelin, "Real-time
// segmentation of surgical instruments inside the abdominal cavity using a joint hue saturation color
// feature" (Real-Time Imaging, 2005) have it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "sim/render/picture.h"

namespace kiroku::sim {

struct Cover {
  static constexpr int kShrink = 2;  // a cell is so many pixels of the picture wide and high
  int width = 0, height = 0;
  std::vector<std::uint8_t> covered;  // (height x width), 0 or 1, rows from the top

  /// Of a pixel of the picture; those beyond the last whole cell are of that cell.
  [[nodiscard]] bool at(int x, int y) const {
    const int column = x / kShrink < width ? x / kShrink : width - 1,
              row = y / kShrink < height ? y / kShrink : height - 1;
    return covered[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                   static_cast<std::size_t>(column)] != 0;
  }
};

/// Grey that is not dark, and what is not red above all; with a seam of two cells, where lens and codec mix
/// colours. Dark is covered where it is a straight shaft that comes from the picture's border, as cavities
/// are dark, too.
Cover cover_of(const Picture& picture);

}  // namespace kiroku::sim
