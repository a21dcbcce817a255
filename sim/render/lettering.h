// Words in pictures: captions, and the scale of a stress. Not thread-safe.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "sim/render/picture.h"

namespace kiroku::sim {

/// DejaVu Sans as Debian's fonts-dejavu-core has it.
inline constexpr const char* kFontFile = "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf";

/// One font. The same words give the same pixels.
class Lettering {
 public:
  /// kiroku::Error with what to install.
  explicit Lettering(const std::filesystem::path& font = kFontFile);
  ~Lettering();
  Lettering(const Lettering&) = delete;
  Lettering& operator=(const Lettering&) = delete;

  /// UTF-8, in one line from (left, baseline) on, `height` pixels high, over what is there; what reaches out
  /// of the picture is left out. Bytes that are no UTF-8 become "?".
  void draw(Picture& picture, const std::string& text, int left, int baseline, int height, const Rgb& colour);
  /// How far draw() goes to the right, in pixels.
  [[nodiscard]] int width_of(const std::string& text, int height);

 private:
  struct Face;
  std::unique_ptr<Face> face_;
};

/// A line at the picture's lower border, and below the upper one; white on dark pictures, else black. Letters
/// are a 28th of the picture's height, at least 11 pixels.
void draw_caption(Lettering& lettering, Picture& picture, const std::string& above, const std::string& below);

/// Viridis from 0 to `largest_pa` at the right border, with numbers beside it: in Pa, from 10 kPa on in kPa.
void draw_stress_scale(Lettering& lettering, Picture& picture, double largest_pa);

/// Viridis from 0 to `largest_mm` at the right border of a picture of any colours, with numbers of that
/// height beside it and a title above, all before a dark ground.
void draw_displacement_scale(Lettering& lettering, Picture& picture, int height, double largest_mm,
                             const std::string& title = "mm");

}  // namespace kiroku::sim
