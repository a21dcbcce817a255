// The picture of a code: what the display shows. Pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace kiroku::light {

/// A picture of grey samples, rows from the top without gaps.
struct GreyPicture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> samples;
};

/// In cells: the bright frame is one cell wide, and a dark margin of one cell lies around it.
inline constexpr int kPictureRows = 7 + 4, kPictureColumns = 14 + 4;

/// The code, each cell `cell` x `cell` samples, bright 255 and dark 0; all dark where there is none. `cell`
/// must be at least 1.
GreyPicture light_picture(std::optional<std::uint64_t> code, int cell);

}  // namespace kiroku::light
