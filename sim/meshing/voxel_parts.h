// How labelled voxels hang together. Functions are pure and thread-safe; time grows linearly with the map.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sim/volume/volume.h"

namespace kiroku::sim {

/// Voxels that hang together by faces.
struct VoxelPart {
  std::uint16_t label = 0;  // of its first voxel
  std::size_t voxels = 0;
  std::array<std::size_t, 3> central{};  // one of its voxels: that nearest to its centre of mass
};
struct VoxelParts {
  std::vector<std::uint32_t> of_voxel;  // (voxels): 0 for label 0, else 1 + its number in `parts`
  std::vector<VoxelPart> parts;         // in the order of their first voxel
};
/// Parts of one label each.
VoxelParts parts_by_label(const LabelMap& map);
/// Parts whatever their label.
VoxelParts parts_of_body(const LabelMap& map);

/// The smallest box with all labelled voxels and `margin` voxels of label 0 around them, which may reach
/// beyond the map; one voxel of label 0 where nothing is labelled.
LabelMap cropped(const LabelMap& map, std::size_t margin);

struct RemovedParts {
  std::size_t parts = 0, voxels = 0;
};
/// Sets all but the `count` largest parts of the body to 0; of parts of equal size the first stays.
RemovedParts keep_largest_parts(LabelMap& map, std::size_t count);

}  // namespace kiroku::sim
