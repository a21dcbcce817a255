// A CT as numbers in space, and labels in space. Plain data; functions are pure and thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "sim/volume/grid.h"

namespace kiroku::sim {

/// Air on Hounsfield's scale: what is outside a volume, and what padding becomes.
inline constexpr float kAirHu = -1000;

struct Volume {
  Grid grid;
  /// (grid.voxels()), Hounsfield units, finite, i fastest. Single precision holds every whole number a
  /// scanner writes, and what is left of fractional slopes.
  std::vector<float> hu;
};

/// Labels of a segmentation, or regions of a body; 0 is outside.
struct LabelMap {
  Grid grid;
  std::vector<std::uint16_t> labels;  // (grid.voxels()), i fastest
};

/// Trilinear between centres of voxels; kAirHu beyond the outermost centres.
double sample_hu(const Volume& volume, const Vector3& patient_m);

/// The label of the nearest voxel of `map` at each voxel of `grid`; 0 where that lies outside `map`.
LabelMap resampled(const LabelMap& map, const Grid& grid);

}  // namespace kiroku::sim
