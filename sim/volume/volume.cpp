#include "sim/volume/volume.h"

#include <algorithm>
#include <cmath>

namespace kiroku::sim {

double sample_hu(const Volume& volume, const Vector3& patient_m) {
  const Grid& grid = volume.grid;
  const Vector3 index = grid.index(patient_m);
  std::array<std::size_t, 3> low{}, step{};
  std::array<double, 3> fraction{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double at = index[static_cast<Eigen::Index>(axis)];
    const double last = static_cast<double>(grid.size[axis]) - 1;
    // Rounding must not turn the outermost centres into air.
    constexpr double kSlack = 1e-6;
    if (!(at >= -kSlack && at <= last + kSlack)) return kAirHu;
    const double floor = std::clamp(std::floor(at), 0.0, std::max(last - 1, 0.0));
    low[axis] = static_cast<std::size_t>(floor);
    step[axis] = grid.size[axis] > 1 ? 1 : 0;
    fraction[axis] = std::clamp(at - floor, 0.0, 1.0);
  }
  double sum = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    double weight = 1;
    std::array<std::size_t, 3> at = low;
    for (unsigned axis = 0; axis < 3; ++axis) {
      const bool upper = (corner >> axis & 1U) != 0;
      weight *= upper ? fraction[axis] : 1 - fraction[axis];
      if (upper) at[axis] += step[axis];
    }
    sum += weight * static_cast<double>(volume.hu[grid.offset(at[0], at[1], at[2])]);
  }
  return sum;
}

LabelMap resampled(const LabelMap& map, const Grid& grid) {
  LabelMap result{grid, std::vector<std::uint16_t>(grid.voxels())};
  // index(patient_m(.)) is affine: its value at the origin and its change along each axis.
  const Vector3 start = map.grid.index(grid.patient_m(Vector3::Zero()));
  Eigen::Matrix3d change;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    change.col(axis) = map.grid.index(grid.patient_m(Vector3::Unit(axis))) - start;
  }
  const Vector3 last(static_cast<double>(map.grid.size[0]) - 1, static_cast<double>(map.grid.size[1]) - 1,
                     static_cast<double>(map.grid.size[2]) - 1);
  std::size_t offset = 0;
  for (std::size_t k = 0; k < grid.size[2]; ++k) {
    for (std::size_t j = 0; j < grid.size[1]; ++j) {
      const Vector3 row =
          start + change.col(1) * static_cast<double>(j) + change.col(2) * static_cast<double>(k);
      for (std::size_t i = 0; i < grid.size[0]; ++i, ++offset) {
        const Vector3 nearest = (row + change.col(0) * static_cast<double>(i)).array().round();
        if ((nearest.array() >= 0).all() && (nearest.array() <= last.array()).all()) {
          result.labels[offset] = map.labels[map.grid.offset(static_cast<std::size_t>(nearest.x()),
                                                             static_cast<std::size_t>(nearest.y()),
                                                             static_cast<std::size_t>(nearest.z()))];
        }
      }
    }
  }
  return result;
}

}  // namespace kiroku::sim
