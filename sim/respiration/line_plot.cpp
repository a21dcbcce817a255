#include "sim/respiration/line_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/number_text.h"

namespace kiroku::sim {
namespace {

constexpr double kWidth = 780, kHeight = 420, kLeft = 70, kRight = 170, kTop = 40, kBottom = 50;
/// Okabe and Ito's colours, which the colour-blind can tell apart.
constexpr std::array<const char*, 6> kColours{"#0072b2", "#d55e00", "#009e73",
                                              "#cc79a7", "#e69f00", "#000000"};
constexpr std::array<const char*, 6> kDashes{"none", "8 3", "2 3", "10 3 2 3", "5 5", "1 2"};

/// Round ticks around a range.
struct Axis {
  double least = 0, greatest = 0, step = 1;
  Axis(double from, double to, double ticks) {
    const double range = to > from ? to - from : 1;
    const double power = std::pow(10, std::floor(std::log10(range / ticks)));
    step = 10 * power;
    for (const double factor : {1.0, 2.0, 5.0}) {
      if (factor * power * ticks < range) continue;
      step = factor * power;
      break;
    }
    least = std::floor(from / step + 1e-9) * step;
    greatest = std::max(std::ceil(to / step - 1e-9) * step, least + step);
  }
  [[nodiscard]] int count() const { return static_cast<int>(std::lround((greatest - least) / step)); }
  [[nodiscard]] double tick(int i) const { return least + i * step; }
  [[nodiscard]] double part(double value) const { return (value - least) / (greatest - least); }
};

std::string coordinate(double value) { return number_text(std::round(value * 100) / 100, 7); }

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text)
    out += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '>' ? "&gt;" : std::string(1, c);
  return out;
}

std::string text_at(double x, double y, const std::string& anchor, const std::string& text,
                    const std::string& more = "") {
  return "<text x=\"" + coordinate(x) + "\" y=\"" + coordinate(y) + "\" text-anchor=\"" + anchor + "\"" +
         more + ">" + escaped(text) + "</text>\n";
}

std::string line_between(double x1, double y1, double x2, double y2, const std::string& style) {
  return "<line x1=\"" + coordinate(x1) + "\" y1=\"" + coordinate(y1) + "\" x2=\"" + coordinate(x2) +
         "\" y2=\"" + coordinate(y2) + "\" " + style + "/>\n";
}

}  // namespace

std::string plot_svg(const LinePlot& plot) {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  double left = kInfinite, right = -kInfinite, low = kInfinite, high = -kInfinite;
  for (const PlotLine& line : plot.lines) {
    for (const double x : line.x) left = std::min(left, x), right = std::max(right, x);
    for (const double y : line.y) low = std::min(low, y), high = std::max(high, y);
  }
  if (!(left <= right)) left = right = low = high = 0;
  const Axis across(left, right, 8), up(low, high, 6);
  const auto at_x = [&](double x) { return kLeft + (kWidth - kLeft - kRight) * across.part(x); };
  const auto at_y = [&](double y) { return kHeight - kBottom - (kHeight - kTop - kBottom) * up.part(y); };

  std::string svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" + coordinate(kWidth) +
                    "\" height=\"" + coordinate(kHeight) + "\" viewBox=\"0 0 " + coordinate(kWidth) + " " +
                    coordinate(kHeight) +
                    "\" font-family=\"sans-serif\" font-size=\"13\">\n"
                    "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n" +
                    text_at(kLeft, kTop - 16, "start", plot.title, " font-size=\"15\"");
  for (int i = 0; i <= across.count(); ++i) {
    const double x = at_x(across.tick(i));
    svg += line_between(x, kTop, x, kHeight - kBottom, "stroke=\"#dddddd\"") +
           text_at(x, kHeight - kBottom + 18, "middle", number_text(std::round(across.tick(i) * 1e9) / 1e9));
  }
  for (int i = 0; i <= up.count(); ++i) {
    const double y = at_y(up.tick(i));
    svg += line_between(kLeft, y, kWidth - kRight, y, "stroke=\"#dddddd\"") +
           text_at(kLeft - 8, y + 4, "end", number_text(std::round(up.tick(i) * 1e9) / 1e9));
  }
  svg += "<rect x=\"" + coordinate(kLeft) + "\" y=\"" + coordinate(kTop) + "\" width=\"" +
         coordinate(kWidth - kLeft - kRight) + "\" height=\"" + coordinate(kHeight - kTop - kBottom) +
         "\" fill=\"none\" stroke=\"#444444\"/>\n" +
         text_at((kLeft + kWidth - kRight) / 2, kHeight - 10, "middle", plot.x_label) +
         text_at(18, (kTop + kHeight - kBottom) / 2, "middle", plot.y_label,
                 " transform=\"rotate(-90 18 " + coordinate((kTop + kHeight - kBottom) / 2) + ")\"");
  for (std::size_t i = 0; i < plot.lines.size(); ++i) {
    const PlotLine& line = plot.lines[i];
    const std::string colour = kColours[i % kColours.size()];
    const std::string style = "stroke=\"" + colour + "\" stroke-width=\"2\" stroke-dasharray=\"" +
                              kDashes[i % kDashes.size()] + "\"";
    const double legend_y = kTop + 14 + 22 * static_cast<double>(i), legend_x = kWidth - kRight + 14;
    svg += text_at(legend_x + 36, legend_y + 4, "start", line.name);
    const auto mark = [&](double x, double y) {
      svg += "<circle cx=\"" + coordinate(x) + "\" cy=\"" + coordinate(y) +
             "\" r=\"3\" fill=\"none\" stroke=\"" + colour + "\"/>\n";
    };
    if (line.points) {
      mark(legend_x + 14, legend_y);
      for (std::size_t j = 0; j < line.x.size(); ++j) mark(at_x(line.x[j]), at_y(line.y[j]));
      continue;
    }
    svg += line_between(legend_x, legend_y, legend_x + 30, legend_y, style) + "<polyline fill=\"none\" " +
           style + " points=\"";
    for (std::size_t j = 0; j < line.x.size(); ++j)
      svg += (j == 0 ? "" : " ") + coordinate(at_x(line.x[j])) + "," + coordinate(at_y(line.y[j]));
    svg += "\"/>\n";
  }
  return svg + "</svg>\n";
}

}  // namespace kiroku::sim
