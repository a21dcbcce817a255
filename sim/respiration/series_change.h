// How well a motion explains that the pictures of a series differ from each other. Pure, thread-safe for
// scenes of their own.
#pragma once

#include <span>
#include <vector>

#include "sim/respiration/breathing_pictures.h"

namespace kiroku::sim {

/// A radiograph, and how far the motion has the lung at its moment.
struct MovedPicture {
  std::size_t view = 0;
  const ProjectionImage* image = nullptr;  // of the view's pixels
  BreathState state;
};

struct SeriesChange {
  /// How alike the change of the pictures from their mean is to that of their DRRs (correlation of
  /// gradients), and the root mean square that the same DRRs reach in another order.
  double explained = 0, by_chance = 0;
};

/// Tables of DRRs have a node every `step_m` of the diaphragm. Zero where nothing changes.
SeriesChange explained_change(const BreathingScene& scene, const std::vector<ProjectionGeometry>& views,
                              std::span<const MovedPicture> pictures, double step_m);

}  // namespace kiroku::sim
