// Lines over time as a picture (SVG 1.1): trajectories, residuals. Pure, thread-safe.
#pragma once

#include <string>
#include <vector>

namespace kiroku::sim {

struct PlotLine {
  std::string name;
  std::vector<double> x, y;  // as many of both, finite
  bool points = false;       // marks without a line between them
};
struct LinePlot {
  std::string title, x_label, y_label;
  std::vector<PlotLine> lines;  // up to six, each with a colour and a dash of its own
};
/// Axes have round ticks that enclose all values. The same plot gives the same bytes.
std::string plot_svg(const LinePlot& plot);

}  // namespace kiroku::sim
