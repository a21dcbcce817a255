// A CT's attenuation as the ray kernel reads it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "sim/drr/attenuation.h"
#include "sim/drr/ray_kernel.h"
#include "sim/volume/volume.h"

namespace kiroku::sim {

/// Attenuation in steps of 1/32767 of the greatest there is, four bytes a voxel for each of the three
/// directions that rays run along, made when first asked for. Thread-safe.
class RayVoxels {
 public:
  /// kiroku::Error for a volume of more voxels than can be numbered.
  RayVoxels(const Volume& volume, const Attenuation& attenuation, unsigned threads);

  [[nodiscard]] const Grid& grid() const { return grid_; }
  /// Attenuation of one step, 1/m; positive.
  [[nodiscard]] double step_per_m() const { return step_per_m_; }

  /// Which axes of the grid are column and row of the planes across `axis`.
  static constexpr std::array<Eigen::Index, 3> kColumnAxis{1, 0, 0}, kRowAxis{2, 2, 1};
  /// For rays that run along an axis of the grid; lives as long as this.
  [[nodiscard]] RayVolume along(std::size_t axis) const;

 private:
  struct Direction {
    std::once_flag made;
    std::unique_ptr<std::uint32_t, void (*)(void*)> quads{nullptr, nullptr};
    RayVolume volume;
  };
  void make(std::size_t axis, Direction& direction) const;

  Grid grid_;
  double step_per_m_ = 1;
  unsigned threads_;
  std::vector<std::uint16_t> steps_;  // (grid.voxels()), i fastest
  mutable std::array<Direction, 3> directions_;
};

}  // namespace kiroku::sim
