// Texts set in the documents' fonts: DejaVu Sans and DejaVu Sans Mono, IPAPGothic for Japanese. Lengths in
// points. An object is used by one thread.
#pragma once

#include <string>
#include <string_view>

#include "viewer/report/document.h"
#include "viewer/report/language.h"
#include "viewer/report/pango_handles.h"

namespace kiroku::report {

struct TextStyle {
  double size = 9;
  Face face = Face::kText;
  Alignment alignment = Alignment::kLeft;
};

/// A text broken into lines of a width. Not copied, since Pango's layouts are shared by reference.
class SetText {
 public:
  /// `leading`: the distance of lines, by the font's own.
  SetText(PangoHandle<PangoLayout> layout, double width, double leading);
  [[nodiscard]] int lines() const;
  [[nodiscard]] double line_height(int line) const;
  [[nodiscard]] double height() const;
  /// Of the widest line.
  [[nodiscard]] double ink_width() const;
  /// Lines [first, last), the upper left corner of the first at (x, y).
  void draw(cairo_t* canvas, double x, double y, int first, int last) const;
  void draw(cairo_t* canvas, double x, double y) const { draw(canvas, x, y, 0, lines()); }
  /// The first line with its baseline at y.
  void draw_on_baseline(cairo_t* canvas, double x, double y) const;

 private:
  PangoHandle<PangoLayout> layout_;
  double leading_;
};

class Typesetter {
 public:
  /// Throws kiroku::Error naming the package where a font that the language needs is not installed.
  explicit Typesetter(Language language);
  [[nodiscard]] SetText set(std::string_view text, const TextStyle& style, double width) const;
  /// On one line, cut off with an ellipsis beyond `most` (0: no limit).
  [[nodiscard]] SetText set_line(std::string_view text, const TextStyle& style, double most) const;

 private:
  [[nodiscard]] PangoHandle<PangoLayout> layout(std::string_view text, const TextStyle& style) const;
  void require_font(const char* family, const char* package) const;

  Language language_;
  PangoHandle<PangoFontMap> fonts_;
  PangoHandle<PangoContext> context_;
};

}  // namespace kiroku::report
