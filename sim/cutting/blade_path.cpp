#include "sim/cutting/blade_path.h"

#include <string>

#include "base/error.h"

namespace kiroku::sim {

std::vector<SweepSurface> sweep_surfaces(const std::vector<BladePose>& path) {
  if (path.size() < 2) {
    throw UsageError("a blade's path has " + std::to_string(path.size()) +
                     " poses: a cut needs two at least");
  }
  std::vector<SweepSurface> surfaces;
  surfaces.reserve(path.size() - 1);
  for (std::size_t pose = 1; pose < path.size(); ++pose) {
    try {
      surfaces.emplace_back(path[pose - 1], path[pose]);
    } catch (const UsageError& error) {
      throw UsageError("from pose " + std::to_string(pose - 1) + " to " + std::to_string(pose) + " " +
                       error.what());
    }
  }
  return surfaces;
}

}  // namespace kiroku::sim
