#include "sim/drr/overlay.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/error.h"
#include "sim/mesh/mesh_topology.h"

namespace kiroku::sim {
namespace {

constexpr std::size_t kSquare = 32;
constexpr double kHalfWidth = 0.75;
constexpr Colour kContourColour{0, 220, 255};

/// From 0 to 1 in the window.
std::vector<double> grey_of(const ProjectionImage& image, const Window& window) {
  std::vector<double> grey;
  grey.reserve(image.values.size());
  for (const float value : image.values) {
    grey.push_back(std::clamp((double(value) - window.low) / (window.high - window.low), 0.0, 1.0));
  }
  return grey;
}

std::uint8_t byte_of(double part) {
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(part, 0.0, 1.0)));
}
Colour grey_colour(double part) { return {byte_of(part), byte_of(part), byte_of(part)}; }
Colour mixed(const Colour& under, const Colour& over, double part) {
  Colour result{};
  for (std::size_t i = 0; i < 3; ++i) result[i] = byte_of(((1 - part) * under[i] + part * over[i]) / 255);
  return result;
}

/// Grey, turning to orange above zero and to blue below.
Colour difference_colour(double difference) {
  constexpr double kGain = 2;
  const double part = std::clamp(kGain * difference, -1.0, 1.0);
  const Colour middle{128, 128, 128}, above{255, 140, 0}, below{0, 110, 255};
  return mixed(middle, part > 0 ? above : below, std::abs(part));
}

/// Lengths of the gradient, as parts of its 97 % quantile.
std::vector<double> edges_of(const std::vector<double>& grey, std::size_t columns, std::size_t rows) {
  std::vector<double> edges(grey.size(), 0);
  for (std::size_t row = 1; row + 1 < rows; ++row) {
    for (std::size_t column = 1; column + 1 < columns; ++column) {
      const std::size_t at = row * columns + column;
      edges[at] = std::hypot(grey[at + 1] - grey[at - 1], grey[at + columns] - grey[at - columns]);
    }
  }
  std::vector<double> sorted = edges;
  const auto quantile = static_cast<std::ptrdiff_t>(0.97 * double(sorted.size()));
  std::nth_element(sorted.begin(), sorted.begin() + quantile, sorted.end());
  const double most = sorted[static_cast<std::size_t>(quantile)];
  if (most > 0) {
    for (double& edge : edges) edge /= most;
  }
  return edges;
}

}  // namespace

OverlayWindows overlay_windows(const ProjectionImage& radiograph, const ProjectionImage& drr) {
  return {window_of(radiograph, Response::kFilm), window_of(drr, Response::kFilm)};
}

ColourPicture overlay_of(const ProjectionImage& radiograph, const ProjectionImage& drr, OverlayMode mode,
                         double opacity, const std::optional<OverlayWindows>& windows) {
  if (radiograph.columns != drr.columns || radiograph.rows != drr.rows || drr.values.empty()) {
    throw Error("the radiograph has " + std::to_string(radiograph.columns) + " x " +
                std::to_string(radiograph.rows) + " pixels, the DRR " + std::to_string(drr.columns) + " x " +
                std::to_string(drr.rows));
  }
  const OverlayWindows shown = windows ? *windows : overlay_windows(radiograph, drr);
  const std::vector<double> below = grey_of(radiograph, shown.radiograph), above = grey_of(drr, shown.drr);
  const std::size_t columns = drr.columns, width = mode == OverlayMode::kBeside ? 2 * columns : columns;
  ColourPicture picture{width, drr.rows, std::vector<Colour>(width * drr.rows)};
  const std::vector<double> edges =
      mode == OverlayMode::kContour ? edges_of(above, columns, drr.rows) : std::vector<double>();
  for (std::size_t row = 0; row < drr.rows; ++row) {
    for (std::size_t column = 0; column < columns; ++column) {
      const std::size_t at = row * columns + column;
      Colour& pixel = picture.pixels[row * width + column];
      switch (mode) {
        case OverlayMode::kOpacity:
          pixel = grey_colour((1 - opacity) * below[at] + opacity * above[at]);
          break;
        case OverlayMode::kDifference:
          pixel = difference_colour(above[at] - below[at]);
          break;
        case OverlayMode::kCheckerboard:
          pixel = grey_colour((row / kSquare + column / kSquare) % 2 == 0 ? below[at] : above[at]);
          break;
        case OverlayMode::kContour:
          // Only what stands out, fading in.
          pixel = mixed(grey_colour(below[at]), kContourColour, std::clamp(2 * edges[at] - 1, 0.0, 1.0));
          break;
        case OverlayMode::kBeside:
          pixel = grey_colour(below[at]);
          picture.pixels[row * width + columns + column] = grey_colour(above[at]);
          break;
        case OverlayMode::kWipe:
          pixel = grey_colour(double(column) + 0.5 < opacity * double(columns) ? above[at] : below[at]);
          break;
      }
    }
  }
  return picture;
}

void draw(ColourPicture& picture, std::span<const PixelLine> lines, const Colour& colour, double right_by) {
  // Where lines meet, the pixel is covered once.
  std::vector<float> cover(picture.pixels.size(), 0.0F);
  const auto last_column = double(picture.columns) - 1, last_row = double(picture.rows) - 1;
  for (const PixelLine& line : lines) {
    const Eigen::Vector2d from(line.from[0] + right_by, line.from[1]), to(line.to[0] + right_by, line.to[1]);
    const Eigen::Vector2d along = to - from;
    const double squared = along.squaredNorm();
    constexpr double kReach = kHalfWidth + 1;
    const double left = std::min(from.x(), to.x()) - kReach, right = std::max(from.x(), to.x()) + kReach,
                 top = std::min(from.y(), to.y()) - kReach, bottom = std::max(from.y(), to.y()) + kReach;
    if (!(right >= 0 && left <= last_column && bottom >= 0 && top <= last_row)) continue;
    const auto first_column = static_cast<std::size_t>(std::max(left, 0.0)),
               first_row = static_cast<std::size_t>(std::max(top, 0.0));
    for (std::size_t row = first_row; double(row) <= std::min(bottom, last_row); ++row) {
      for (std::size_t column = first_column; double(column) <= std::min(right, last_column); ++column) {
        const Eigen::Vector2d at = Eigen::Vector2d(double(column), double(row)) - from;
        const double part = squared > 0 ? std::clamp(at.dot(along) / squared, 0.0, 1.0) : 0;
        const double distance = (at - part * along).norm();
        float& covered = cover[row * picture.columns + column];
        covered = std::max(covered, static_cast<float>(std::clamp(kHalfWidth + 0.5 - distance, 0.0, 1.0)));
      }
    }
  }
  for (std::size_t at = 0; at < cover.size(); ++at) {
    if (cover[at] > 0) picture.pixels[at] = mixed(picture.pixels[at], colour, double(cover[at]));
  }
}

std::vector<PixelLine> path_of(std::span<const Vector3> points_m, const ProjectionGeometry& geometry) {
  std::vector<PixelLine> lines;
  for (std::size_t i = 1; i < points_m.size(); ++i) {
    const auto from = geometry.project(points_m[i - 1]), to = geometry.project(points_m[i]);
    if (from && to) lines.push_back({{from->column, from->row}, {to->column, to->row}});
  }
  return lines;
}

std::vector<PixelLine> outline_of(const TetMesh& mesh, std::int32_t region,
                                  const ProjectionGeometry& geometry) {
  TetMesh part;
  part.nodes = mesh.nodes;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    if (mesh.regions[t] != region) continue;
    part.tetrahedra.push_back(mesh.tetrahedra[t]);
    part.regions.push_back(region);
  }
  // How many of an edge's faces look to the source, and how many away.
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::array<int, 2>> facing;
  for (const Face& face : faces_of(part).surface) {
    const Vector3 &a = part.nodes[face.nodes[0]], &b = part.nodes[face.nodes[1]],
                  &c = part.nodes[face.nodes[2]];
    const bool away = (b - a).cross(c - a).dot(a - geometry.source_m()) > 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(face.nodes[i], face.nodes[(i + 1) % 3]);
      ++facing[{low, high}][away ? 1 : 0];
    }
  }
  std::vector<PixelLine> lines;
  for (const auto& [edge, counts] : facing) {
    if (counts[0] == 0 || counts[1] == 0) continue;
    const std::array<Vector3, 2> ends{part.nodes[edge.first], part.nodes[edge.second]};
    for (const PixelLine& line : path_of(ends, geometry)) lines.push_back(line);
  }
  return lines;
}

}  // namespace kiroku::sim
