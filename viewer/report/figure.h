// A drawing of lines, areas and short texts in points (1/72 inch), origin top left, for whatever writes it:
// PDF by Cairo, HTML as SVG. Plain values.
#pragma once

#include <string>
#include <variant>
#include <vector>

namespace kiroku::report {

/// Greys and one blue, as sRGB: they keep their order when printed without colours.
enum class Ink { kBlack, kGrey, kPale, kBlue, kWhite };
/// "#1f4e79".
const char* ink_hex(Ink ink);

struct Area {
  double x = 0, y = 0, width = 0, height = 0;
  Ink fill = Ink::kPale;
};
struct Stroke {
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  Ink ink = Ink::kBlack;
  double width = 0.6;
};
struct Lettering {
  enum class Anchor { kStart, kMiddle, kEnd };
  double x = 0, baseline = 0;
  std::string text;
  double size = 8;
  Anchor anchor = Anchor::kStart;
  double most = 0;  // longer text is cut off with an ellipsis; 0: no limit
};
using Shape = std::variant<Area, Stroke, Lettering>;

struct Figure {
  double width = 0, height = 0;
  std::string description;  // for who cannot see it
  std::vector<Shape> shapes;
};

}  // namespace kiroku::report
