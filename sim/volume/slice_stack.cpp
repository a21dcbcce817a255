#include "sim/volume/slice_stack.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "base/number_text.h"

namespace kiroku::sim {
namespace {

std::string millimetres(double metres) { return number_text(1000 * metres, 4); }

/// The value between four pixels of one slice; kAirHu beside it.
double sample_slice(const SliceStack& stack, const float* hu, double column, double row) {
  const double last_column = static_cast<double>(stack.columns) - 1,
               last_row = static_cast<double>(stack.rows) - 1;
  if (!(column >= 0 && column <= last_column && row >= 0 && row <= last_row)) return kAirHu;
  const auto left = static_cast<std::size_t>(std::min(column, std::max(last_column - 1, 0.0)));
  const auto above = static_cast<std::size_t>(std::min(row, std::max(last_row - 1, 0.0)));
  const std::size_t right = std::min(left + 1, stack.columns - 1),
                    below = std::min(above + 1, stack.rows - 1);
  const double across = column - static_cast<double>(left), down = row - static_cast<double>(above);
  const auto pixel = [&](std::size_t i, std::size_t j) {
    return static_cast<double>(hu[i + stack.columns * j]);
  };
  return (1 - down) * ((1 - across) * pixel(left, above) + across * pixel(right, above)) +
         down * ((1 - across) * pixel(left, below) + across * pixel(right, below));
}

}  // namespace

Vector3 SliceStack::normal() const { return along_row.cross(down_column).normalized(); }

Irregularity irregularity_of(const SliceStack& stack) {
  const Vector3 normal = stack.normal();
  const std::vector<Vector3>& positions = stack.positions_m;
  const Vector3 whole = positions.back() - positions.front();
  const double height = normal.dot(whole), mean_gap = height / static_cast<double>(positions.size() - 1);
  const double half_pixel = 0.5 * std::min(stack.column_spacing_m, stack.row_spacing_m);
  Irregularity found;
  std::vector<double> gaps;
  for (std::size_t slice = 0; slice < positions.size(); ++slice) {
    const Vector3 from_first = positions[slice] - positions.front();
    const double along = normal.dot(from_first);
    if (slice > 0) gaps.push_back(normal.dot(positions[slice] - positions[slice - 1]));
    found.uneven =
        found.uneven || std::abs(along - static_cast<double>(slice) * mean_gap) > kMostUnevenness * mean_gap;
    found.tilted = found.tilted || (from_first - along * normal).norm() > half_pixel;
  }
  std::ranges::sort(gaps);
  found.least_gap_m = gaps.front();
  found.median_gap_m = gaps[gaps.size() / 2];
  found.greatest_gap_m = gaps.back();
  found.tilt_rad = std::atan2((whole - height * normal).norm(), height);
  if (found.uneven) {
    found.text = "its slices lie " + millimetres(found.least_gap_m) + " to " +
                 millimetres(found.greatest_gap_m) + " mm apart (median " + millimetres(found.median_gap_m) +
                 ")";
  }
  if (found.tilted) {
    found.text += (found.uneven ? " and" : "its slices") +
                  std::string(" are shifted against each other, as by a gantry tilted by ") +
                  number_text(found.tilt_rad * 180 / std::numbers::pi, 3) + " degrees";
  }
  return found;
}

Grid regular_grid(const SliceStack& stack) {
  Grid grid;
  grid.size = {stack.columns, stack.rows, stack.positions_m.size()};
  const Vector3 normal = stack.normal();
  grid.spacing_m = {stack.column_spacing_m, stack.row_spacing_m,
                    normal.dot(stack.positions_m.back() - stack.positions_m.front()) /
                        static_cast<double>(stack.positions_m.size() - 1)};
  grid.origin_m = stack.positions_m.front();
  grid.direction << stack.along_row, stack.down_column, normal;
  return grid;
}

Volume resampled_stack(const SliceStack& stack, const std::vector<float>& hu) {
  const std::size_t slices = stack.positions_m.size();
  // Where each slice begins, in pixels along its rows and columns and in metres along the normal.
  std::vector<Vector3> start(slices);
  Vector3 least = Vector3::Zero(), greatest = Vector3::Zero();
  for (std::size_t slice = 0; slice < slices; ++slice) {
    const Vector3 from_first = stack.positions_m[slice] - stack.positions_m.front();
    start[slice] = {stack.along_row.dot(from_first) / stack.column_spacing_m,
                    stack.down_column.dot(from_first) / stack.row_spacing_m, stack.normal().dot(from_first)};
    least = least.cwiseMin(start[slice]);
    greatest = greatest.cwiseMax(start[slice]);
  }
  const double finest =
      std::max(irregularity_of(stack).least_gap_m, std::min(stack.column_spacing_m, stack.row_spacing_m));
  constexpr double kSlack = 1e-6;  // of rounding, so that nothing grows by a voxel for it
  const auto steps = [](double length) { return static_cast<std::size_t>(std::ceil(length - kSlack)); };
  Volume volume;
  Grid& grid = volume.grid;
  grid.size = {stack.columns + steps(greatest.x() - least.x()), stack.rows + steps(greatest.y() - least.y()),
               1 + static_cast<std::size_t>(std::floor(greatest.z() / finest + kSlack))};
  grid.spacing_m = {stack.column_spacing_m, stack.row_spacing_m, finest};
  grid.direction << stack.along_row, stack.down_column, stack.normal();
  grid.origin_m = stack.positions_m.front() + stack.along_row * least.x() * stack.column_spacing_m +
                  stack.down_column * least.y() * stack.row_spacing_m;
  volume.hu.resize(grid.voxels());
  std::size_t offset = 0, lower = 0;
  for (std::size_t k = 0; k < grid.size[2]; ++k) {
    const double height = static_cast<double>(k) * finest;
    while (lower + 2 < slices && start[lower + 1].z() <= height) ++lower;
    const std::size_t upper = lower + 1;
    const double part =
        std::clamp((height - start[lower].z()) / (start[upper].z() - start[lower].z()), 0.0, 1.0);
    const float* const below = hu.data() + lower * stack.columns * stack.rows;
    const float* const above = below + stack.columns * stack.rows;
    for (std::size_t j = 0; j < grid.size[1]; ++j) {
      for (std::size_t i = 0; i < grid.size[0]; ++i, ++offset) {
        const double column = least.x() + static_cast<double>(i), row = least.y() + static_cast<double>(j);
        volume.hu[offset] = static_cast<float>(
            (1 - part) * sample_slice(stack, below, column - start[lower].x(), row - start[lower].y()) +
            part * sample_slice(stack, above, column - start[upper].x(), row - start[upper].y()));
      }
    }
  }
  return volume;
}

}  // namespace kiroku::sim
