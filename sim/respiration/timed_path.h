// Where a point is over time: a tumour, as it was computed or measured. Plain data, immutable after it was
// read.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

struct TimedPath {
  std::vector<double> times_s;  // at least two, each later than the one before
  std::vector<Vector3> points_m;

  /// Evenly between two of its moments; nothing before the first and after the last.
  [[nodiscard]] std::optional<Vector3> place_at(double time_s) const;
  /// The same where the path is one breath, which follows itself; the time from its last place to its first
  /// is that between the last two.
  [[nodiscard]] Vector3 place_in_breath(double time_s) const;
};

/// The columns time_s, x_mm, y_mm, z_mm (or _m), as 'kiroku sim respire' writes them. kiroku::Error with the
/// line, kiroku::IoError.
TimedPath read_timed_path(const std::filesystem::path& file);
/// `name` stands in errors.
TimedPath parse_timed_path(std::string_view text, const std::string& name);

}  // namespace kiroku::sim
