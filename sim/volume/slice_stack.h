// Parallel slices, as a scanner makes them, and the regular grid they are or can be resampled to. Functions
// are pure and thread-safe.
#pragma once

#include <string>
#include <vector>

#include "sim/volume/volume.h"

namespace kiroku::sim {

/// At least two slices of the same size, spacing and direction.
struct SliceStack {
  std::size_t columns = 0, rows = 0;
  double column_spacing_m = 0, row_spacing_m = 0;
  Vector3 along_row = Vector3::UnitX(), down_column = Vector3::UnitY();
  std::vector<Vector3> positions_m;  // centres of their first pixels, ascending along normal()

  [[nodiscard]] Vector3 normal() const;  // along_row x down_column
};

/// Of a stack that is not regular: slices more than kMostUnevenness of the mean gap from where they should
/// be, or shifted against each other by more than half a pixel in total.
struct Irregularity {
  double least_gap_m = 0, median_gap_m = 0, greatest_gap_m = 0;
  double tilt_rad = 0;  // between the stack's axis and the slices' normal: a tilted gantry
  bool uneven = false, tilted = false;
  /// "its slices lie 4 to 7 mm apart (median 7) and are tilted by 18.5 degrees"; empty where it is regular.
  std::string text;
};
inline constexpr double kMostUnevenness = 0.05;
Irregularity irregularity_of(const SliceStack& stack);

/// The grid of a regular stack; right-handed.
Grid regular_grid(const SliceStack& stack);

/// `hu` (columns x rows x slices) on a regular grid that holds all slices: as wide as they are in all, as
/// fine as the least gap but no finer than the pixels; linear between slices and pixels, kAirHu beside them.
Volume resampled_stack(const SliceStack& stack, const std::vector<float>& hu);

}  // namespace kiroku::sim
