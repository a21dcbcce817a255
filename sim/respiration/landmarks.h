// Points that a person found in two volumes of one patient. Pure functions, thread-safe.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// How well people find the same point twice, mean and standard deviation: what every error at landmarks has
/// to be read beside. (Published for landmarks in lungs; see docs/explanation/respiration.md.)
inline constexpr double kObserverMm = 0.9, kObserverSpreadMm = 0.8;

/// A point a line, x y z in millimetres (left, back, head), separated by spaces, tabs or commas; lines that
/// begin with # do not count. Files as elastix writes them, with "point" and the number of points on two
/// lines of their own, are known; "index" is refused, as it counts voxels of a volume that is not named.
/// kiroku::Error with the line for anything else, and for another number of points than the file says.
std::vector<Vector3> parse_landmarks_m(std::string_view text, const std::string& name);
std::vector<Vector3> read_landmarks_m(const std::filesystem::path& file);

/// Points before and after; kiroku::Error with both counts where they differ, or there is none.
struct LandmarkPairs {
  std::vector<Vector3> fixed_m, moving_m;
};
LandmarkPairs read_landmark_pairs(const std::filesystem::path& fixed, const std::filesystem::path& moving);

/// Of lengths: how they spread. Zero for none.
struct Spread {
  std::size_t count = 0;
  double mean = 0, deviation = 0, median = 0, percentile_95 = 0, greatest = 0;
};
Spread spread_of(std::vector<double> lengths);

}  // namespace kiroku::sim
