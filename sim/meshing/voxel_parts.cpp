#include "sim/meshing/voxel_parts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace kiroku::sim {
namespace {

std::array<std::size_t, 3> voxel_at(const Grid& grid, std::size_t offset) {
  return {offset % grid.size[0], offset / grid.size[0] % grid.size[1], offset / grid.size[0] / grid.size[1]};
}

/// The voxel of each part that is nearest to its centre of mass, the first of several.
void find_central_voxels(const Grid& grid, VoxelParts& parts) {
  std::vector<Vector3> centre(parts.parts.size(), Vector3::Zero());
  const auto as_vector = [&](std::size_t offset) {
    const auto at = voxel_at(grid, offset);
    return Vector3(static_cast<double>(at[0]), static_cast<double>(at[1]), static_cast<double>(at[2]));
  };
  for (std::size_t offset = 0; offset < parts.of_voxel.size(); ++offset) {
    if (parts.of_voxel[offset] != 0) centre[parts.of_voxel[offset] - 1] += as_vector(offset);
  }
  for (std::size_t part = 0; part < centre.size(); ++part) {
    centre[part] /= static_cast<double>(parts.parts[part].voxels);
  }
  std::vector<double> nearest(centre.size(), std::numeric_limits<double>::infinity());
  for (std::size_t offset = 0; offset < parts.of_voxel.size(); ++offset) {
    if (parts.of_voxel[offset] == 0) continue;
    const std::size_t part = parts.of_voxel[offset] - 1;
    const double squared = (as_vector(offset) - centre[part]).cwiseProduct(grid.spacing_m).squaredNorm();
    if (squared < nearest[part]) {
      nearest[part] = squared;
      parts.parts[part].central = voxel_at(grid, offset);
    }
  }
}

/// `joined(a, b)` of the labels of two voxels that share a face, neither of them 0.
template <typename Joined>
VoxelParts find_parts(const LabelMap& map, Joined joined) {
  VoxelParts result;
  result.of_voxel.resize(map.labels.size());
  const auto& size = map.grid.size;
  const std::array<std::size_t, 3> stride{1, size[0], size[0] * size[1]};
  std::vector<std::size_t> reached;
  for (std::size_t first = 0; first < map.labels.size(); ++first) {
    if (map.labels[first] == 0 || result.of_voxel[first] != 0) continue;
    const auto number = static_cast<std::uint32_t>(result.parts.size() + 1);
    result.parts.push_back({map.labels[first], 0, {}});
    result.of_voxel[first] = number;
    reached.push_back(first);
    while (!reached.empty()) {
      const std::size_t offset = reached.back();
      reached.pop_back();
      ++result.parts.back().voxels;
      const auto at = voxel_at(map.grid, offset);
      const auto visit = [&](std::size_t neighbour) {
        if (map.labels[neighbour] == 0 || result.of_voxel[neighbour] != 0) return;
        if (!joined(map.labels[offset], map.labels[neighbour])) return;
        result.of_voxel[neighbour] = number;
        reached.push_back(neighbour);
      };
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (at[axis] > 0) visit(offset - stride[axis]);
        if (at[axis] + 1 < size[axis]) visit(offset + stride[axis]);
      }
    }
  }
  find_central_voxels(map.grid, result);
  return result;
}

}  // namespace

VoxelParts parts_by_label(const LabelMap& map) {
  return find_parts(map, [](std::uint16_t a, std::uint16_t b) { return a == b; });
}

VoxelParts parts_of_body(const LabelMap& map) {
  return find_parts(map, [](std::uint16_t, std::uint16_t) { return true; });
}

LabelMap cropped(const LabelMap& map, std::size_t margin) {
  const auto& size = map.grid.size;
  std::array<std::size_t, 3> low = size, high{};
  std::size_t offset = 0;
  for (std::size_t k = 0; k < size[2]; ++k) {
    for (std::size_t j = 0; j < size[1]; ++j) {
      for (std::size_t i = 0; i < size[0]; ++i, ++offset) {
        if (map.labels[offset] == 0) continue;
        const std::array<std::size_t, 3> at{i, j, k};
        for (std::size_t axis = 0; axis < 3; ++axis) {
          low[axis] = std::min(low[axis], at[axis]);
          high[axis] = std::max(high[axis], at[axis] + 1);
        }
      }
    }
  }
  LabelMap result{map.grid, {}};
  if (high[0] == 0) {
    result.grid.size = {1, 1, 1};
    result.labels.assign(1, 0);
    return result;
  }
  const Vector3 least(static_cast<double>(low[0]), static_cast<double>(low[1]), static_cast<double>(low[2]));
  result.grid.origin_m = map.grid.patient_m(least - Vector3::Constant(static_cast<double>(margin)));
  for (std::size_t axis = 0; axis < 3; ++axis) result.grid.size[axis] = high[axis] - low[axis] + 2 * margin;
  result.labels.resize(result.grid.voxels());
  for (std::size_t k = low[2]; k < high[2]; ++k) {
    for (std::size_t j = low[1]; j < high[1]; ++j) {
      const auto* const from = map.labels.data() + map.grid.offset(low[0], j, k);
      std::copy_n(
          from, high[0] - low[0],
          result.labels.data() + result.grid.offset(margin, j - low[1] + margin, k - low[2] + margin));
    }
  }
  return result;
}

RemovedParts keep_largest_parts(LabelMap& map, std::size_t count) {
  const VoxelParts found = parts_of_body(map);
  if (found.parts.size() <= count) return {};
  std::vector<std::size_t> by_size(found.parts.size());
  std::iota(by_size.begin(), by_size.end(), std::size_t{0});
  std::ranges::stable_sort(
      by_size, [&](std::size_t a, std::size_t b) { return found.parts[a].voxels > found.parts[b].voxels; });
  std::vector<bool> kept(found.parts.size());
  for (std::size_t rank = 0; rank < count; ++rank) kept[by_size[rank]] = true;
  RemovedParts removed{found.parts.size() - count, 0};
  for (std::size_t offset = 0; offset < map.labels.size(); ++offset) {
    if (found.of_voxel[offset] == 0 || kept[found.of_voxel[offset] - 1]) continue;
    map.labels[offset] = 0;
    ++removed.voxels;
  }
  return removed;
}

}  // namespace kiroku::sim
