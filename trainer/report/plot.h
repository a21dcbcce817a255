// Results as pictures for papers and screens: points with intervals, lines. By Cairo. Pure, thread-safe.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/bytes.h"
#include "trainer/statistics/comparison.h"

namespace kiroku::trainer {

struct PlotSeries {
  std::string name;
  std::vector<double> x, y;         // as many of both, finite
  std::vector<Interval> intervals;  // of y, drawn as bars; as many, or none
  bool line = true;                 // between the points
};
struct Plot {
  std::string title, x_label, y_label;
  std::vector<PlotSeries> series;  // up to six colours, which the colour-blind can tell apart
  bool logarithmic_y = false;      // all y and intervals greater than zero
  bool whole_x = false;            // ticks at whole numbers only: fingers, sessions
  std::string note;                // a line below: what the data are
  bool logarithmic_x = false;      // all x greater than zero
};

enum class PlotForm { kSvg, kPdf, kPng };
/// By the ending: .svg, .pdf, .png; kiroku::UsageError for others.
PlotForm plot_form(const std::string& file);
/// A file's bytes. kiroku::UsageError for series of uneven lengths and numbers that cannot be drawn;
/// kiroku::Error where Cairo fails.
Bytes plot_file(const Plot& plot, PlotForm form);

/// A document of A4 pages (PDF): headings, text, tables and plots, one below the other.
struct ReportBlock {
  std::string heading;                          // may be empty
  std::string text;                             // a paragraph; may be empty
  std::vector<std::vector<std::string>> table;  // rows of cells, the first is the head; may be empty
  std::optional<Plot> plot;
};
Bytes report_pdf(const std::string& title, const std::vector<ReportBlock>& blocks);

}  // namespace kiroku::trainer
