#include "sim/render/lettering.h"

#include <algorithm>
#include <cmath>
#include <ft2build.h>
#include FT_FREETYPE_H

#include "base/error.h"
#include "base/number_text.h"
#include "sim/render/colour_map.h"

namespace kiroku::sim {
namespace {

struct LibraryDeleter {
  void operator()(FT_Library library) const noexcept { FT_Done_FreeType(library); }
};
struct FaceDeleter {
  void operator()(FT_Face face) const noexcept { FT_Done_Face(face); }
};

// FreeType counts in 64ths of a pixel.
constexpr int kFixedPoint = 64;

/// The next character of UTF-8, and how many bytes it has; "?" for one byte that is none.
std::pair<char32_t, std::size_t> character_at(const std::string& text, std::size_t at) {
  const auto byte = [&](std::size_t i) -> unsigned {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0;
  };
  const unsigned first = byte(at);
  if (first < 0x80) return {first, 1};
  const std::size_t length = first >= 0xF0 && first < 0xF8 ? 4 : first >= 0xE0 ? 3 : first >= 0xC0 ? 2 : 0;
  if (length == 0 || first >= 0xF8) return {U'?', 1};
  char32_t character = first & (0x7FU >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xC0U) != 0x80) return {U'?', 1};
    character = character << 6U | (byte(at + i) & 0x3FU);
  }
  return {character, length};
}

int letter_height(const Picture& picture) { return std::max(11, picture.height / 28); }

Rgb readable_on(const Picture& picture) {
  constexpr int kMiddle = 128;
  const std::uint8_t* const corner = picture.pixel(0, 0);
  return (corner[0] + 2 * corner[1] + corner[2]) / 4 < kMiddle ? Rgb{235, 235, 235} : Rgb{20, 20, 20};
}

}  // namespace

struct Lettering::Face {
  std::unique_ptr<FT_LibraryRec_, LibraryDeleter> library;
  std::unique_ptr<FT_FaceRec_, FaceDeleter> face;
  int height = 0;

  void set_height(int pixels) {
    if (pixels == height) return;
    FT_Set_Pixel_Sizes(face.get(), 0, static_cast<FT_UInt>(pixels));
    height = pixels;
  }
  /// The glyph's picture; nullptr where the font cannot give any.
  FT_GlyphSlot glyph(char32_t character) {
    // Without hinting, which versions of FreeType do differently.
    if (FT_Load_Char(face.get(), character, FT_LOAD_RENDER | FT_LOAD_NO_HINTING) != 0) return nullptr;
    return face->glyph;
  }
};

Lettering::Lettering(const std::filesystem::path& font) : face_(std::make_unique<Face>()) {
  FT_Library library = nullptr;
  if (FT_Init_FreeType(&library) != 0) throw Error("FreeType, which draws letters, cannot be begun");
  face_->library.reset(library);
  FT_Face face = nullptr;
  if (FT_New_Face(library, font.c_str(), 0, &face) != 0) {
    throw Error("the letters of pictures need the font " + font.string() +
                ", which cannot be read: install Debian's fonts-dejavu-core");
  }
  face_->face.reset(face);
}

Lettering::~Lettering() = default;

void Lettering::draw(Picture& picture, const std::string& text, int left, int baseline, int height,
                     const Rgb& colour) {
  face_->set_height(height);
  FT_Pos pen = FT_Pos{left} * kFixedPoint;
  for (std::size_t at = 0; at < text.size();) {
    const auto [character, length] = character_at(text, at);
    at += length;
    const FT_GlyphSlot glyph = face_->glyph(character);
    if (glyph == nullptr) continue;
    const FT_Bitmap& bitmap = glyph->bitmap;
    const int x0 = static_cast<int>(pen / kFixedPoint) + glyph->bitmap_left,
              y0 = baseline - glyph->bitmap_top;
    for (int row = 0; row < static_cast<int>(bitmap.rows); ++row) {
      for (int column = 0; column < static_cast<int>(bitmap.width); ++column) {
        const int x = x0 + column, y = y0 + row;
        if (x < 0 || y < 0 || x >= picture.width || y >= picture.height) continue;
        const int cover = bitmap.buffer[row * bitmap.pitch + column];
        std::uint8_t* const pixel = picture.pixel(x, y);
        for (std::size_t c = 0; c < 3; ++c)
          pixel[c] = static_cast<std::uint8_t>((pixel[c] * (255 - cover) + colour[c] * cover + 127) / 255);
      }
    }
    pen += glyph->advance.x;
  }
}

int Lettering::width_of(const std::string& text, int height) {
  face_->set_height(height);
  FT_Pos width = 0;
  for (std::size_t at = 0; at < text.size();) {
    const auto [character, length] = character_at(text, at);
    at += length;
    if (const FT_GlyphSlot glyph = face_->glyph(character); glyph != nullptr) width += glyph->advance.x;
  }
  return static_cast<int>((width + kFixedPoint - 1) / kFixedPoint);
}

void draw_caption(Lettering& lettering, Picture& picture, const std::string& above,
                  const std::string& below) {
  const int height = letter_height(picture), margin = height * 2 / 3;
  const Rgb colour = readable_on(picture);
  lettering.draw(picture, above, margin, margin + height, height, colour);
  lettering.draw(picture, below, margin, picture.height - margin, height, colour);
}

void draw_displacement_scale(Lettering& lettering, Picture& picture, int height, double largest_mm,
                             const std::string& title) {
  const int margin = height / 2, bar = height, long_side = picture.height * 2 / 5;
  const int wide = std::max(3 * margin + bar + lettering.width_of(number_text(largest_mm, 4), height),
                            2 * margin + lettering.width_of(title, height));
  const int left = std::max(0, picture.width - wide - margin), top = margin;
  const int below = std::min(picture.height, top + long_side + 3 * height);
  for (int y = top; y < below; ++y) {
    for (int x = left; x < picture.width - margin; ++x) {
      // A quarter of what is there shines through.
      for (int c = 0; c < 3; ++c)
        picture.pixel(x, y)[c] = static_cast<std::uint8_t>(picture.pixel(x, y)[c] / 4);
    }
  }
  const Rgb colour{235, 235, 235};
  const int right = picture.width - 2 * margin, first = top + 2 * height;
  lettering.draw(picture, title, right - lettering.width_of(title, height), top + height, height, colour);
  for (int y = 0; y < long_side && first + y < picture.height; ++y) {
    const Rgb shade = viridis(1 - double(y) / (long_side - 1));
    for (int x = std::max(0, right - bar); x < right; ++x)
      std::ranges::copy(shade, picture.pixel(x, first + y));
  }
  for (const double share : {0.0, 0.5, 1.0}) {
    const std::string number = number_text(largest_mm * share, 4);
    const int y = first + static_cast<int>((1 - share) * (long_side - 1));
    lettering.draw(picture, number, right - bar - margin - lettering.width_of(number, height), y + height / 3,
                   height, colour);
  }
}

void draw_stress_scale(Lettering& lettering, Picture& picture, double largest_pa) {
  const int height = letter_height(picture), bar = height, long_side = picture.height / 2;
  const Rgb colour = readable_on(picture);
  constexpr double kLeastOfKilopascals = 1e4;  // five digits and more are hard to read
  const double unit_pa = largest_pa < kLeastOfKilopascals ? 1 : 1e3;
  const std::string title = unit_pa == 1 ? "von Mises stress, Pa" : "von Mises stress, kPa";
  const int right = picture.width - height * 2 / 3, top = (picture.height - long_side) / 2;
  lettering.draw(picture, title, right - lettering.width_of(title, height), top - height, height, colour);
  for (int y = 0; y < long_side; ++y) {
    const Rgb shade = viridis(1 - double(y) / (long_side - 1));
    for (int x = std::max(0, right - bar); x < right; ++x)
      std::copy(shade.begin(), shade.end(), picture.pixel(x, top + y));
  }
  constexpr int kNumbers = 4;
  for (int i = 0; i <= kNumbers; ++i) {
    const std::string number = number_text(largest_pa / unit_pa * i / kNumbers, 4);
    const int y = top + long_side - 1 - (long_side - 1) * i / kNumbers;
    lettering.draw(picture, number, right - bar - height / 3 - lettering.width_of(number, height),
                   y + height / 3, height, colour);
  }
}

}  // namespace kiroku::sim
