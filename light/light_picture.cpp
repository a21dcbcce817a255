#include "light/light_picture.h"

#include "light/light_code.h"

namespace kiroku::light {
namespace {

bool is_lit(std::uint64_t code, int row, int column) {
  constexpr int kFrame = 1, kInside = 2;
  if (row < kFrame || column < kFrame || row >= kPictureRows - kFrame || column >= kPictureColumns - kFrame)
    return false;
  if (row < kInside || column < kInside || row >= kPictureRows - kInside ||
      column >= kPictureColumns - kInside)
    return true;
  return is_bright(code, row - kInside, column - kInside);
}

}  // namespace

GreyPicture light_picture(std::optional<std::uint64_t> code, int cell) {
  static_assert(kPictureRows == kRows + 4 && kPictureColumns == kColumns + 4);
  GreyPicture picture{kPictureColumns * cell, kPictureRows * cell, {}};
  picture.samples.assign(static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height),
                         0);
  if (!code) return picture;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      if (is_lit(*code, y / cell, x / cell)) {
        picture.samples[static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) +
                        static_cast<std::size_t>(x)] = 255;
      }
    }
  }
  return picture;
}

}  // namespace kiroku::light
