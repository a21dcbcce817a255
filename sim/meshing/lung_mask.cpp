#include "sim/meshing/lung_mask.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "base/error.h"
#include "sim/meshing/voxel_parts.h"

namespace kiroku::sim {
namespace {

constexpr float kAirBelowHu = -400;
constexpr double kLeastLungM3 = 50e-6;
constexpr double kSecondLungPart = 0.1;
/// A windpipe in an axial slice: its size, its air, how far it is to the left or right of the middle, and how
/// deep it is sought.
constexpr double kLeastTracheaM2 = 50e-6, kGreatestTracheaM2 = 900e-6, kLumenHu = -880, kOffMiddleM = 0.04;
constexpr double kSoughtM = 0.06;
/// The airway's threshold goes up in steps until it leaks into the lung.
constexpr double kFirstAirwayHu = -980, kLastAirwayHu = -860, kAirwayStepHu = 15;
constexpr double kMostAirwayM3 = 100e-6, kLeak = 1.6;
/// The airway's wall, between its air and the lung's.
constexpr double kWallM = 0.002;
/// Larger holes are no vessels, but what lies between two lungs that touch.
constexpr double kGreatestHoleM2 = 1e-3;

using Voxel = std::array<std::size_t, 3>;

LabelMap slice_of(const LabelMap& map, std::size_t k) {
  LabelMap slice{map.grid, {}};
  slice.grid.size[2] = 1;
  const std::size_t voxels = slice.grid.voxels();
  const auto begin = map.labels.begin() + static_cast<std::ptrdiff_t>(k * voxels);
  slice.labels.assign(begin, begin + static_cast<std::ptrdiff_t>(voxels));
  return slice;
}

/// Whether each part touches the sides of the grid, along i or j.
std::vector<bool> reaches_sides(const VoxelParts& parts, const Grid& grid) {
  std::vector<bool> reaches(parts.parts.size());
  for (std::size_t k = 0; k < grid.size[2]; ++k) {
    for (std::size_t j = 0; j < grid.size[1]; ++j) {
      const bool whole_row = j == 0 || j + 1 == grid.size[1];
      const std::size_t step = whole_row ? 1 : std::max<std::size_t>(grid.size[0] - 1, 1);
      for (std::size_t i = 0; i < grid.size[0]; i += step) {
        if (const std::uint32_t part = parts.of_voxel[grid.offset(i, j, k)]; part != 0)
          reaches[part - 1] = true;
      }
    }
  }
  return reaches;
}

/// Air within the body.
LabelMap inner_air(const Volume& volume) {
  LabelMap air{volume.grid, std::vector<std::uint16_t>(volume.hu.size())};
  std::ranges::transform(volume.hu, air.labels.begin(),
                         [](float hu) { return static_cast<std::uint16_t>(hu < kAirBelowHu ? 1 : 0); });
  const VoxelParts parts = parts_of_body(air);
  const std::vector<bool> outside = reaches_sides(parts, air.grid);
  for (std::size_t voxel = 0; voxel < air.labels.size(); ++voxel) {
    if (parts.of_voxel[voxel] != 0 && outside[parts.of_voxel[voxel] - 1]) air.labels[voxel] = 0;
  }
  return air;
}

template <typename Action>
void for_each_neighbour(const Grid& grid, std::size_t offset, Action action) {
  const Voxel at{offset % grid.size[0], offset / grid.size[0] % grid.size[1],
                 offset / grid.size[0] / grid.size[1]};
  const Voxel stride{1, grid.size[0], grid.size[0] * grid.size[1]};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (at[axis] > 0) action(offset - stride[axis]);
    if (at[axis] + 1 < grid.size[axis]) action(offset + stride[axis]);
  }
}

/// The mean of the 27 voxels around one, those at the border repeated: against noise.
double smoothed_hu(const Volume& volume, std::size_t offset) {
  const Voxel& size = volume.grid.size;
  const Voxel at{offset % size[0], offset / size[0] % size[1], offset / size[0] / size[1]};
  double sum = 0;
  for (int dk = -1; dk <= 1; ++dk) {
    for (int dj = -1; dj <= 1; ++dj) {
      for (int di = -1; di <= 1; ++di) {
        const std::array<int, 3> step{di, dj, dk};
        Voxel near = at;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          if (step[axis] < 0 && near[axis] > 0) --near[axis];
          if (step[axis] > 0 && near[axis] + 1 < size[axis]) ++near[axis];
        }
        sum += static_cast<double>(volume.hu[volume.grid.offset(near[0], near[1], near[2])]);
      }
    }
  }
  return sum / 27;
}

double left_m(const Grid& grid, const Voxel& at) {
  return grid.patient_m({static_cast<double>(at[0]), static_cast<double>(at[1]), static_cast<double>(at[2])})
      .x();
}

/// Where the middle of the body is between left and right, by what is no air in a slice.
double middle_m(const Volume& volume, std::size_t k) {
  double sum = 0, count = 0;
  for (std::size_t j = 0; j < volume.grid.size[1]; ++j) {
    for (std::size_t i = 0; i < volume.grid.size[0]; ++i) {
      if (volume.hu[volume.grid.offset(i, j, k)] < kAirBelowHu) continue;
      sum += left_m(volume.grid, {i, j, k});
      ++count;
    }
  }
  return sum / std::max(count, 1.0);
}

/// A voxel of the windpipe in the slice nearest to the head that shows one.
std::optional<Voxel> find_trachea(const Volume& volume, const LabelMap& air) {
  const Grid& grid = volume.grid;
  const bool head_last = grid.direction(2, 2) > 0;
  const auto sought = std::min(grid.size[2], static_cast<std::size_t>(kSoughtM / grid.spacing_m.z()) + 1);
  for (std::size_t from_head = 0; from_head < sought; ++from_head) {
    const std::size_t k = head_last ? grid.size[2] - 1 - from_head : from_head;
    const double middle = middle_m(volume, k);
    double nearest_m = kOffMiddleM;
    std::optional<Voxel> found;
    for (const VoxelPart& part : parts_of_body(slice_of(air, k)).parts) {
      const Voxel at{part.central[0], part.central[1], k};
      const double area_m2 = static_cast<double>(part.voxels) * grid.spacing_m.x() * grid.spacing_m.y();
      const double off_m = std::abs(left_m(grid, at) - middle);
      const bool is_lumen = smoothed_hu(volume, grid.offset(at[0], at[1], at[2])) < kLumenHu;
      if (!is_lumen || area_m2 < kLeastTracheaM2 || area_m2 > kGreatestTracheaM2 || off_m >= nearest_m)
        continue;
      nearest_m = off_m;
      found = at;
    }
    if (found) return found;
  }
  return std::nullopt;
}

/// Air that hangs together with the seed and is thinner than this; nothing where it is more than `most`
/// voxels.
std::vector<std::size_t> grow(const Volume& volume, const LabelMap& air, std::size_t seed, double below_hu,
                              std::size_t most) {
  std::vector<bool> reached(air.labels.size());
  std::vector<std::size_t> grown{seed};
  reached[seed] = true;
  for (std::size_t next = 0; next < grown.size(); ++next) {
    for_each_neighbour(volume.grid, grown[next], [&](std::size_t neighbour) {
      if (reached[neighbour] || air.labels[neighbour] == 0 || smoothed_hu(volume, neighbour) >= below_hu)
        return;
      reached[neighbour] = true;
      grown.push_back(neighbour);
    });
    if (grown.size() > most) return {};
  }
  return grown;
}

/// Takes the airway out of the air, with its wall; its volume.
double remove_airway(const Volume& volume, LabelMap& air, const Voxel& trachea) {
  const Grid& grid = volume.grid;
  const double voxel_m3 = grid.spacing_m.prod();
  const std::size_t seed = grid.offset(trachea[0], trachea[1], trachea[2]);
  const auto most = static_cast<std::size_t>(kMostAirwayM3 / voxel_m3);
  std::vector<std::size_t> airway;
  for (double below_hu = kFirstAirwayHu; below_hu <= kLastAirwayHu; below_hu += kAirwayStepHu) {
    std::vector<std::size_t> grown = grow(volume, air, seed, below_hu, most);
    constexpr std::size_t kFew = 1000;  // a seed in noise may grow at any rate
    if (grown.empty() || (airway.size() > kFew &&
                          static_cast<double>(grown.size()) > kLeak * static_cast<double>(airway.size())))
      break;
    airway = std::move(grown);
  }
  const double airway_m3 = static_cast<double>(airway.size()) * voxel_m3;
  // Smoothing keeps what grows a voxel off the wall.
  const int layers = 1 + static_cast<int>(std::lround(kWallM / grid.spacing_m.head<2>().minCoeff()));
  for (const std::size_t voxel : airway) air.labels[voxel] = 0;
  std::vector<std::size_t> front = airway;
  for (int layer = 0; layer < layers; ++layer) {
    std::vector<std::size_t> next;
    for (const std::size_t voxel : front) {
      for_each_neighbour(grid, voxel, [&](std::size_t neighbour) {
        if (air.labels[neighbour] == 0) return;
        air.labels[neighbour] = 0;
        next.push_back(neighbour);
      });
    }
    front = std::move(next);
  }
  return airway_m3;
}

/// Vessels within the lungs: holes of a slice.
void fill_holes(LabelMap& map) {
  const double voxel_m2 = map.grid.spacing_m.x() * map.grid.spacing_m.y();
  const std::size_t slice_voxels = map.grid.size[0] * map.grid.size[1];
  for (std::size_t k = 0; k < map.grid.size[2]; ++k) {
    LabelMap around = slice_of(map, k);
    for (std::uint16_t& label : around.labels) label = label == 0 ? 1 : 0;
    const VoxelParts parts = parts_of_body(around);
    const std::vector<bool> open = reaches_sides(parts, around.grid);
    for (std::size_t voxel = 0; voxel < slice_voxels; ++voxel) {
      const std::uint32_t part = parts.of_voxel[voxel];
      if (part == 0 || open[part - 1]) continue;
      if (static_cast<double>(parts.parts[part - 1].voxels) * voxel_m2 > kGreatestHoleM2) continue;
      map.labels[k * slice_voxels + voxel] = 1;
    }
  }
}

/// The largest one or two.
std::size_t keep_lungs(LabelMap& air) {
  std::vector<std::size_t> sizes;
  for (const VoxelPart& part : parts_of_body(air).parts) sizes.push_back(part.voxels);
  std::ranges::sort(sizes, std::greater());
  if (sizes.empty() || static_cast<double>(sizes[0]) * air.grid.spacing_m.prod() < kLeastLungM3) {
    throw Error(
        "cannot find the lungs by their HU: there is no air within the body that is as large as a lung");
  }
  const bool second =
      sizes.size() > 1 && static_cast<double>(sizes[1]) >= kSecondLungPart * static_cast<double>(sizes[0]);
  keep_largest_parts(air, second ? 2 : 1);
  return second ? 2 : 1;
}

}  // namespace

LungMask find_lungs(const Volume& volume) {
  if (std::abs(volume.grid.direction(2, 2)) < 0.9) {
    throw Error(
        "cannot find the lungs by their HU: the volume's slices are not axial; give a segmentation "
        "(--labels)");
  }
  LungMask result;
  result.map = inner_air(volume);
  if (const std::optional<Voxel> trachea = find_trachea(volume, result.map)) {
    result.airway_ml = 1e6 * remove_airway(volume, result.map, *trachea);
  }
  result.lungs = keep_lungs(result.map);
  fill_holes(result.map);
  return result;
}

}  // namespace kiroku::sim
