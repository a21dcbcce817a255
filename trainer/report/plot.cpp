#include "trainer/report/plot.h"

#include <algorithm>
#include <array>
#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <cairo.h>
#include <cmath>
#include <limits>
#include <memory>
#include <sstream>

#include "base/error.h"
#include "base/number_text.h"

namespace kiroku::trainer {
namespace {

struct CairoDeleter {
  void operator()(cairo_t* context) const { cairo_destroy(context); }
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};
using Context = std::unique_ptr<cairo_t, CairoDeleter>;
using Surface = std::unique_ptr<cairo_surface_t, CairoDeleter>;

struct Colour {
  double red, green, blue;
};
/// Okabe and Ito's.
constexpr std::array<Colour, 6> kColours{{{0, 0.447, 0.698},
                                          {0.835, 0.369, 0},
                                          {0, 0.62, 0.451},
                                          {0.8, 0.475, 0.655},
                                          {0.902, 0.624, 0},
                                          {0, 0, 0}}};
constexpr Colour kInk{0.13, 0.13, 0.13}, kGrid{0.87, 0.87, 0.87};
constexpr double kPlotWidth = 520, kPlotHeight = 320;

void check(cairo_status_t status, const char* what) {
  if (status != CAIRO_STATUS_SUCCESS)
    throw Error(std::string("cannot draw ") + what + ": " + cairo_status_to_string(status));
}

cairo_status_t append(void* into, const unsigned char* data, unsigned length) {
  auto* bytes = static_cast<Bytes*>(into);
  const auto* from = reinterpret_cast<const std::byte*>(data);
  bytes->insert(bytes->end(), from, from + length);
  return CAIRO_STATUS_SUCCESS;
}

/// A pen on one surface: text, lines, marks. Lengths in points.
class Pen {
 public:
  explicit Pen(cairo_surface_t* surface) : context_(cairo_create(surface)) {
    check(cairo_status(context_.get()), "a picture");
    cairo_select_font_face(context_.get(), "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  }
  [[nodiscard]] cairo_t* raw() const { return context_.get(); }
  void colour(const Colour& c) { cairo_set_source_rgb(raw(), c.red, c.green, c.blue); }
  void line(double x1, double y1, double x2, double y2, double width) {
    cairo_set_line_width(raw(), width);
    cairo_move_to(raw(), x1, y1);
    cairo_line_to(raw(), x2, y2);
    cairo_stroke(raw());
  }
  [[nodiscard]] double width_of(const std::string& text, double size) {
    cairo_set_font_size(raw(), size);
    cairo_text_extents_t extents;
    cairo_text_extents(raw(), text.c_str(), &extents);
    return extents.x_advance;
  }
  /// `anchor`: 0 begins at x, 0.5 is centred on it, 1 ends there.
  void text(double x, double y, double anchor, const std::string& words, double size) {
    const double width = width_of(words, size);
    cairo_move_to(raw(), x - anchor * width, y);
    cairo_show_text(raw(), words.c_str());
  }
  void turned_text(double x, double y, const std::string& words, double size) {
    cairo_save(raw());
    cairo_translate(raw(), x, y);
    cairo_rotate(raw(), -std::acos(0));
    text(0, 0, 0.5, words, size);
    cairo_restore(raw());
  }
  void dot(double x, double y, double radius) {
    cairo_new_path(raw());  // text leaves a point behind
    cairo_arc(raw(), x, y, radius, 0, 4 * std::acos(0));
    cairo_fill(raw());
  }

 private:
  Context context_;
};

/// Round ticks that enclose a range; of a logarithmic one 1, 2 and 5 of each power.
class Axis {
 public:
  Axis(double least, double greatest, bool logarithmic, bool whole) : logarithmic_(logarithmic) {
    if (logarithmic_) {
      for (int power = static_cast<int>(std::floor(std::log10(least)));
           ticks_.empty() || ticks_.back() < greatest; ++power) {
        for (const double factor : {1.0, 2.0, 5.0}) {
          const double tick = factor * std::pow(10, power);
          if (tick > least) {
            if (ticks_.empty()) ticks_.push_back(before_);
            if (ticks_.back() < greatest) ticks_.push_back(tick);
          }
          before_ = tick;
        }
      }
      return;
    }
    // Closer together than numbers can tell ticks apart is one place.
    const double magnitude = std::max(std::abs(least), std::abs(greatest));
    const double range = greatest - least > 1e-9 * magnitude ? greatest - least : std::max(magnitude, 1.0);
    constexpr double kTicks = 6;
    const double power = std::pow(10, std::floor(std::log10(range / kTicks)));
    double step = 10 * power;
    for (const double factor : {1.0, 2.0, 5.0}) {
      if (factor * power * kTicks < range) continue;
      step = factor * power;
      break;
    }
    if (whole) step = std::max(std::ceil(step), 1.0);
    double tick = std::floor(least / step + 1e-9) * step;
    for (; tick < greatest - 1e-9 * range || ticks_.size() < 2; tick += step)
      ticks_.push_back(std::round(tick / step) * step);
    ticks_.push_back(std::round(tick / step) * step);
  }
  [[nodiscard]] const std::vector<double>& ticks() const { return ticks_; }
  [[nodiscard]] double share(double value) const {
    const auto scaled = [&](double v) { return logarithmic_ ? std::log10(v) : v; };
    return (scaled(value) - scaled(ticks_.front())) / (scaled(ticks_.back()) - scaled(ticks_.front()));
  }

 private:
  bool logarithmic_;
  double before_ = 0;
  std::vector<double> ticks_;
};

void require_valid(const Plot& plot) {
  const auto good_y = [&](double y) { return std::isfinite(y) && (!plot.logarithmic_y || y > 0); };
  const auto good_x = [&](double x) { return std::isfinite(x) && (!plot.logarithmic_x || x > 0); };
  for (const PlotSeries& series : plot.series) {
    if (series.x.size() != series.y.size() ||
        (!series.intervals.empty() && series.intervals.size() != series.y.size()))
      throw UsageError("the series '" + series.name + "' of a plot has x, y and intervals of unequal number");
    const bool sound = std::ranges::all_of(series.x, good_x) && std::ranges::all_of(series.y, good_y) &&
                       std::ranges::all_of(series.intervals, [&](const Interval& i) {
                         return good_y(i.low) && good_y(i.high);
                       });
    if (!sound)
      throw UsageError("the series '" + series.name + "' of a plot has a number that cannot be drawn");
  }
}

void draw(Pen& pen, const Plot& plot, double left, double top) {
  double x_least = std::numeric_limits<double>::infinity(), x_greatest = -x_least;
  double y_least = x_least, y_greatest = x_greatest;
  for (const PlotSeries& series : plot.series) {
    for (const double x : series.x) x_least = std::min(x_least, x), x_greatest = std::max(x_greatest, x);
    for (const double y : series.y) y_least = std::min(y_least, y), y_greatest = std::max(y_greatest, y);
    for (const Interval& i : series.intervals)
      y_least = std::min(y_least, i.low), y_greatest = std::max(y_greatest, i.high);
  }
  if (!(x_least <= x_greatest))
    x_least = plot.logarithmic_x ? 1 : 0, y_least = plot.logarithmic_y ? 1 : 0, x_greatest = y_greatest = 1;
  constexpr double kLeft = 58, kRight = 118, kTop = 34, kBottom = 56;
  const Axis across(x_least, x_greatest * (plot.logarithmic_x ? 1.0001 : 1), plot.logarithmic_x,
                    plot.whole_x);
  const Axis up(y_least, y_greatest * (plot.logarithmic_y ? 1.0001 : 1), plot.logarithmic_y, false);
  const double from_x = left + kLeft, to_x = left + kPlotWidth - kRight, from_y = top + kPlotHeight - kBottom,
               to_y = top + kTop;
  const auto at_x = [&](double x) {
    // Points at whole numbers stay off the frame.
    const double inset = plot.whole_x ? 18 : 0;
    return from_x + inset + (to_x - from_x - 2 * inset) * across.share(x);
  };
  const auto at_y = [&](double y) { return from_y + (to_y - from_y) * up.share(y); };
  pen.colour(kInk);
  pen.text(from_x, top + 18, 0, plot.title, 12);
  for (const double tick : across.ticks()) {
    pen.colour(kGrid);
    pen.line(at_x(tick), from_y, at_x(tick), to_y, 0.6);
    pen.colour(kInk);
    pen.text(at_x(tick), from_y + 14, 0.5, number_text(tick), 9);
  }
  for (const double tick : up.ticks()) {
    pen.colour(kGrid);
    pen.line(from_x, at_y(tick), to_x, at_y(tick), 0.6);
    pen.colour(kInk);
    pen.text(from_x - 6, at_y(tick) + 3, 1, number_text(tick), 9);
  }
  pen.line(from_x, from_y, to_x, from_y, 1);
  pen.line(from_x, from_y, from_x, to_y, 1);
  pen.text((from_x + to_x) / 2, from_y + 30, 0.5, plot.x_label, 10);
  pen.turned_text(left + 14, (from_y + to_y) / 2, plot.y_label, 10);
  pen.text(from_x, from_y + 48, 0, plot.note, 8.5);
  for (std::size_t s = 0; s < plot.series.size(); ++s) {
    const PlotSeries& series = plot.series[s];
    pen.colour(kColours[s % kColours.size()]);
    for (std::size_t i = 0; i < series.y.size(); ++i) {
      const double x = at_x(series.x[i]), y = at_y(series.y[i]);
      if (series.line && i > 0) pen.line(at_x(series.x[i - 1]), at_y(series.y[i - 1]), x, y, 1.4);
      if (!series.intervals.empty()) {
        const double low = at_y(series.intervals[i].low), high = at_y(series.intervals[i].high);
        pen.line(x, low, x, high, 1);
        pen.line(x - 3, low, x + 3, low, 1);
        pen.line(x - 3, high, x + 3, high, 1);
      }
      pen.dot(x, y, 2.6);
    }
    const double legend_y = to_y + 8 + 16 * static_cast<double>(s);
    pen.dot(to_x + 12, legend_y - 3, 3);
    pen.colour(kInk);
    pen.text(to_x + 20, legend_y, 0, series.name, 9);
  }
}

void finish(const Surface& surface, const char* what) {
  cairo_surface_finish(surface.get());
  check(cairo_surface_status(surface.get()), what);
}

/// Words into lines no wider than `width`.
std::vector<std::string> wrapped(Pen& pen, const std::string& text, double size, double width) {
  std::vector<std::string> lines(1);
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    const std::string longer = lines.back().empty() ? word : lines.back() + " " + word;
    if (!lines.back().empty() && pen.width_of(longer, size) > width) {
      lines.push_back(word);
    } else {
      lines.back() = longer;
    }
  }
  return lines;
}

/// Where the next line of a document stands; begins a page where the last is full.
class Pages {
 public:
  static constexpr double kWidth = 595.28, kHeight = 841.89, kMargin = 37;
  explicit Pages(Pen& pen) : pen_(pen) {}
  /// The top of a block so high; a block is never parted.
  double take(double height) {
    if (y_ + height > kHeight - kMargin && y_ > kMargin) {
      cairo_show_page(pen_.raw());
      y_ = kMargin;
    }
    y_ += height;
    return y_ - height;
  }

 private:
  Pen& pen_;
  double y_ = kMargin;
};

void draw_table(Pen& pen, Pages& pages, const std::vector<std::vector<std::string>>& table) {
  constexpr double kSize = 8.5, kRow = 13, kGap = 10;
  std::vector<double> widths;
  for (const auto& row : table) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i)
      widths[i] = std::max(widths[i], pen.width_of(row[i], kSize) + kGap);
  }
  for (std::size_t r = 0; r < table.size(); ++r) {
    const double top = pages.take(kRow);
    double x = Pages::kMargin;
    pen.colour(kInk);
    for (std::size_t i = 0; i < table[r].size(); ++i) {
      pen.text(x, top + kRow - 4, 0, table[r][i], kSize);
      x += widths[i];
    }
    if (r == 0) pen.line(Pages::kMargin, top + kRow, x, top + kRow, 0.6);
  }
  pages.take(kRow / 2);
}

}  // namespace

PlotForm plot_form(const std::string& file) {
  if (file.ends_with(".svg")) return PlotForm::kSvg;
  if (file.ends_with(".pdf")) return PlotForm::kPdf;
  if (file.ends_with(".png")) return PlotForm::kPng;
  throw UsageError("'" + file + "' is no plot: its ending must be .svg, .pdf or .png");
}

Bytes plot_file(const Plot& plot, PlotForm form) {
  require_valid(plot);
  Bytes bytes;
  constexpr double kPixels = 2;  // a point, in PNG
  Surface surface;
  if (form == PlotForm::kSvg) {
    surface.reset(cairo_svg_surface_create_for_stream(append, &bytes, kPlotWidth, kPlotHeight));
  } else if (form == PlotForm::kPdf) {
    surface.reset(cairo_pdf_surface_create_for_stream(append, &bytes, kPlotWidth, kPlotHeight));
  } else {
    surface.reset(cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(kPixels * kPlotWidth),
                                             static_cast<int>(kPixels * kPlotHeight)));
  }
  check(cairo_surface_status(surface.get()), "a plot");
  {
    Pen pen(surface.get());
    if (form == PlotForm::kPng) cairo_scale(pen.raw(), kPixels, kPixels);
    cairo_set_source_rgb(pen.raw(), 1, 1, 1);
    cairo_paint(pen.raw());
    draw(pen, plot, 0, 0);
  }
  if (form == PlotForm::kPng)
    check(cairo_surface_write_to_png_stream(surface.get(), append, &bytes), "a plot");
  finish(surface, "a plot");
  return bytes;
}

Bytes report_pdf(const std::string& title, const std::vector<ReportBlock>& blocks) {
  for (const ReportBlock& block : blocks) {
    if (block.plot) require_valid(*block.plot);
  }
  Bytes bytes;
  const Surface surface(cairo_pdf_surface_create_for_stream(append, &bytes, Pages::kWidth, Pages::kHeight));
  check(cairo_surface_status(surface.get()), "a report");
  // Without streams of objects, which some readers of hospitals do not know.
  cairo_pdf_surface_restrict_to_version(surface.get(), CAIRO_PDF_VERSION_1_4);
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_TITLE, title.c_str());
  {
    Pen pen(surface.get());
    Pages pages(pen);
    const auto lines = [&](const std::string& text, double size) {
      for (const std::string& line : wrapped(pen, text, size, Pages::kWidth - 2 * Pages::kMargin)) {
        const double top = pages.take(1.45 * size);
        pen.colour(kInk);
        pen.text(Pages::kMargin, top + size, 0, line, size);
      }
    };
    lines(title, 16);
    pages.take(8);
    for (const ReportBlock& block : blocks) {
      if (!block.heading.empty()) lines(block.heading, 12);
      if (!block.text.empty()) {
        lines(block.text, 9);
        pages.take(5);
      }
      if (!block.table.empty()) draw_table(pen, pages, block.table);
      if (block.plot) draw(pen, *block.plot, Pages::kMargin, pages.take(kPlotHeight + 6));
    }
    cairo_show_page(pen.raw());
  }
  finish(surface, "a report");
  return bytes;
}

}  // namespace kiroku::trainer
