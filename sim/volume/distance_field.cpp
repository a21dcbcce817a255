#include "sim/volume/distance_field.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"

namespace kiroku::sim {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

/// Memory for lines of one length.
struct Line {
  explicit Line(std::size_t size) : value(size), result(size), vertex(size), border(size + 1) {}
  std::vector<double> value, result;
  std::vector<std::size_t> vertex;
  std::vector<double> border;
};

/// result[q] = min over p of (step (q - p))^2 + value[p].
void lower_envelope(Line& line, double step_m) {
  const std::size_t size = line.value.size();
  const double square = step_m * step_m;
  std::size_t parabolas = 0;
  for (std::size_t q = 0; q < size; ++q) {
    if (line.value[q] == kInfinite) continue;
    const auto at = static_cast<double>(q);
    double border = -kInfinite;
    while (parabolas > 0) {
      const std::size_t p = line.vertex[parabolas - 1];
      const auto before = static_cast<double>(p);
      border = ((line.value[q] - line.value[p]) / square + at * at - before * before) / (2 * (at - before));
      if (border > line.border[parabolas - 1]) break;
      --parabolas;
    }
    if (parabolas == 0) border = -kInfinite;
    line.vertex[parabolas] = q;
    line.border[parabolas] = border;
    ++parabolas;
  }
  if (parabolas == 0) {
    std::ranges::fill(line.result, kInfinite);
    return;
  }
  std::size_t parabola = 0;
  for (std::size_t q = 0; q < size; ++q) {
    while (parabola + 1 < parabolas && line.border[parabola + 1] < static_cast<double>(q)) ++parabola;
    const std::size_t p = line.vertex[parabola];
    const double arm_m = step_m * (static_cast<double>(q) - static_cast<double>(p));
    line.result[q] = arm_m * arm_m + line.value[p];
  }
}

/// Squared distances of the lines along one axis.
void transform(const Grid& grid, std::size_t axis, std::vector<float>& squares) {
  const std::array<std::size_t, 3> stride{1, grid.size[0], grid.size[0] * grid.size[1]};
  const std::size_t first = (axis + 1) % 3, second = (axis + 2) % 3;
  Line line(grid.size[axis]);
  for (std::size_t a = 0; a < grid.size[first]; ++a) {
    for (std::size_t b = 0; b < grid.size[second]; ++b) {
      const std::size_t start = a * stride[first] + b * stride[second];
      for (std::size_t q = 0; q < grid.size[axis]; ++q)
        line.value[q] = static_cast<double>(squares[start + q * stride[axis]]);
      lower_envelope(line, grid.spacing_m[static_cast<Eigen::Index>(axis)]);
      for (std::size_t q = 0; q < grid.size[axis]; ++q)
        squares[start + q * stride[axis]] = static_cast<float>(line.result[q]);
    }
  }
}

}  // namespace

std::vector<float> distances_m(const Grid& grid, const std::vector<std::uint8_t>& marked) {
  std::vector<float> distances(marked.size());
  std::ranges::transform(marked, distances.begin(), [](std::uint8_t mark) {
    return mark != 0 ? 0.0F : std::numeric_limits<float>::infinity();
  });
  for (std::size_t axis = 0; axis < 3; ++axis) transform(grid, axis, distances);
  for (float& distance : distances) distance = std::sqrt(distance);
  return distances;
}

DistanceField signed_distance(const LabelMap& map) {
  std::vector<std::uint8_t> inside(map.labels.size()), outside(map.labels.size());
  for (std::size_t i = 0; i < map.labels.size(); ++i) {
    inside[i] = map.labels[i] != 0 ? 1 : 0;
    outside[i] = map.labels[i] != 0 ? 0 : 1;
  }
  if (std::ranges::count(inside, 1) == 0) throw Error("nothing is labelled, so that there is no surface");
  if (std::ranges::count(outside, 1) == 0)
    throw Error("all voxels are labelled, so that there is no surface: the body must not fill the volume");
  DistanceField field{map.grid, distances_m(map.grid, inside)};
  const std::vector<float> to_outside = distances_m(map.grid, outside);
  // The surface is half-way from a centre inside to its neighbour outside.
  const auto voxel_m = static_cast<float>(map.grid.spacing_m.mean());
  for (std::size_t i = 0; i < to_outside.size(); ++i) {
    const float distance_m = std::max(field.distance_m[i], to_outside[i]);
    const float to_surface_m = distance_m - std::min(distance_m, voxel_m) / 2;
    field.distance_m[i] = inside[i] != 0 ? -to_surface_m : to_surface_m;
  }
  return field;
}

SignedDistance sample(const DistanceField& field, const Vector3& patient_m) {
  const Grid& grid = field.grid;
  const Vector3 index = grid.index(patient_m);
  std::array<std::size_t, 3> low{};
  Vector3 fraction, clamped;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    const double last = static_cast<double>(grid.size[axis]) - 1;
    clamped[a] = std::clamp(index[a], 0.0, last);
    const double floor = std::clamp(std::floor(clamped[a]), 0.0, std::max(last - 1, 0.0));
    low[axis] = static_cast<std::size_t>(floor);
    fraction[a] = clamped[a] - floor;
  }
  SignedDistance result;
  Vector3 along_index = Vector3::Zero();
  for (unsigned corner = 0; corner < 8; ++corner) {
    Vector3 weight, slope;
    std::array<std::size_t, 3> at = low;
    for (unsigned axis = 0; axis < 3; ++axis) {
      const bool upper = (corner >> axis & 1U) != 0;
      weight[axis] = upper ? fraction[axis] : 1 - fraction[axis];
      slope[axis] = upper ? 1 : -1;
      if (upper && grid.size[axis] > 1) ++at[axis];
    }
    const auto value = static_cast<double>(field.distance_m[grid.offset(at[0], at[1], at[2])]);
    result.distance_m += weight.prod() * value;
    along_index += value * Vector3(slope[0] * weight[1] * weight[2], weight[0] * slope[1] * weight[2],
                                   weight[0] * weight[1] * slope[2]);
  }
  result.gradient = grid.direction * along_index.cwiseQuotient(grid.spacing_m);
  const Vector3 beyond_m = grid.direction * (index - clamped).cwiseProduct(grid.spacing_m);
  if (beyond_m.squaredNorm() > 0) {
    result.distance_m += beyond_m.norm();
    result.gradient = beyond_m.normalized();
  }
  return result;
}

}  // namespace kiroku::sim
