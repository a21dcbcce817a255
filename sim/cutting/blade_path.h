// Where a blade's edge goes, pose after pose. Pure functions, thread-safe.
#pragma once

#include <vector>

#include "sim/cutting/sweep_surface.h"

namespace kiroku::sim {

/// One surface for each pose after the first, each beginning with the edge the last one ended with.
/// kiroku::UsageError for fewer than two poses, and for what SweepSurface refuses, with the poses' numbers.
std::vector<SweepSurface> sweep_surfaces(const std::vector<BladePose>& path);

}  // namespace kiroku::sim
