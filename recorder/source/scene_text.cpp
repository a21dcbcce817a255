#include "recorder/source/scene_text.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

extern "C" {
#include <libavutil/frame.h>
}

namespace kiroku::recorder {
namespace {

struct Glyph {
  char character;
  std::array<std::uint8_t, kTextRows> rows;  // the leftmost dot is bit 4
};
constexpr Glyph kGlyphs[] = {
    {'0', {0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110}},
    {'1', {0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110}},
    {'2', {0b01110, 0b10001, 0b00001, 0b00010, 0b00100, 0b01000, 0b11111}},
    {'3', {0b11111, 0b00010, 0b00100, 0b00010, 0b00001, 0b10001, 0b01110}},
    {'4', {0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010}},
    {'5', {0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110}},
    {'6', {0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110}},
    {'7', {0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b01000, 0b01000}},
    {'8', {0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110}},
    {'9', {0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100}},
    {'-', {0b00000, 0b00000, 0b00000, 0b11111, 0b00000, 0b00000, 0b00000}},
    {':', {0b00000, 0b01100, 0b01100, 0b00000, 0b01100, 0b01100, 0b00000}},
    {'.', {0b00000, 0b00000, 0b00000, 0b00000, 0b00000, 0b01100, 0b01100}},
    {'U', {0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110}},
    {'T', {0b11111, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100}},
    {'C', {0b01110, 0b10001, 0b10000, 0b10000, 0b10000, 0b10001, 0b01110}},
};
constexpr int kAdvance = kTextColumns + 1;
constexpr int kBorder = 8;         // pixels of the box around the text
constexpr float kDarkness = 0.7F;  // of the box

/// Mixes a rectangle with a colour: all of it where `share` is 1.
void tint(AVFrame& picture, int left, int top, int right, int bottom, const LumaChroma& colour, float share) {
  left = std::max(left, 0);
  top = std::max(top, 0);
  right = std::min(right, picture.width);
  bottom = std::min(bottom, picture.height);
  const std::array<float, 3> samples{colour.luma, colour.blue, colour.red};
  for (int plane = 0; plane < 3; ++plane) {
    const int scale = plane == 0 ? 1 : 2;
    const float added = share * samples[static_cast<std::size_t>(plane)] + 0.5F;
    for (int y = top / scale; y * scale < bottom; ++y) {
      std::uint8_t* const row = picture.data[plane] + std::ptrdiff_t{y} * picture.linesize[plane];
      for (int x = left / scale; x * scale < right; ++x)
        row[x] = static_cast<std::uint8_t>((1 - share) * static_cast<float>(row[x]) + added);
    }
  }
}

}  // namespace

void write_text(AVFrame& picture, int x, int y, int dot, std::string_view text, const Paint& colour) {
  const int columns = static_cast<int>(text.size()) * kAdvance - 1;
  tint(picture, x - kBorder, y - kBorder, x + columns * dot + kBorder, y + kTextRows * dot + kBorder, {},
       kDarkness);
  const LumaChroma ink = luma_chroma_of(colour);
  for (const char character : text) {
    const auto* const glyph = std::ranges::find(kGlyphs, character, &Glyph::character);
    if (glyph != std::end(kGlyphs)) {
      for (int row = 0; row < kTextRows; ++row)
        for (int column = 0; column < kTextColumns; ++column) {
          if ((glyph->rows[static_cast<std::size_t>(row)] >> (kTextColumns - 1 - column) & 1) == 0) continue;
          tint(picture, x + column * dot, y + row * dot, x + (column + 1) * dot, y + (row + 1) * dot, ink, 1);
        }
    }
    x += kAdvance * dot;
  }
}

}  // namespace kiroku::recorder
