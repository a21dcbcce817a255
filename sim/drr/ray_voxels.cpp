#include "sim/drr/ray_voxels.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <new>
#include <sys/mman.h>

#include "base/error.h"
#include "base/parallel.h"

namespace kiroku::sim {
namespace {

constexpr double kMostSteps = 32767;
/// Large pages, where the system has them, spare most misses of the page table's cache.
constexpr std::size_t kPage = std::size_t{2} << 20U;

std::unique_ptr<std::uint32_t, void (*)(void*)> empty_elements(std::size_t count) {
  const std::size_t bytes = (count * sizeof(std::uint32_t) + kPage - 1) / kPage * kPage;
  auto* const memory = static_cast<std::uint32_t*>(std::aligned_alloc(kPage, bytes));
  if (memory == nullptr) throw std::bad_alloc();
  ::madvise(memory, bytes, MADV_HUGEPAGE);
  return {memory, &std::free};
}

}  // namespace

RayVoxels::RayVoxels(const Volume& volume, const Attenuation& attenuation, unsigned threads)
    : grid_(volume.grid), threads_(threads), steps_(volume.hu.size()) {
  double elements = 1;
  for (const std::size_t size : grid_.size) elements *= static_cast<double>(size + 3);
  if (elements > static_cast<double>(std::numeric_limits<std::int32_t>::max())) {
    throw Error("the volume has " + std::to_string(grid_.size[0]) + " x " + std::to_string(grid_.size[1]) +
                " x " + std::to_string(grid_.size[2]) +
                " voxels, more than can be projected; resample it to fewer");
  }
  const std::size_t slice = grid_.size[0] * grid_.size[1];
  std::vector<double> greatest(grid_.size[2], 0);
  for_each_part(grid_.size[2], threads_, [&](std::size_t k) {
    const float* const hu = &volume.hu[k * slice];
    greatest[k] = attenuation.per_m(double(*std::max_element(hu, hu + slice)));
  });
  const double most_per_m = *std::ranges::max_element(greatest);
  if (most_per_m > 0) step_per_m_ = most_per_m / kMostSteps;
  for_each_part(grid_.size[2], threads_, [&](std::size_t k) {
    for (std::size_t at = k * slice; at < (k + 1) * slice; ++at) {
      steps_[at] = static_cast<std::uint16_t>(
          std::min(attenuation.per_m(double(volume.hu[at])) / step_per_m_ + 0.5, kMostSteps));
    }
  });
}

RayVolume RayVoxels::along(std::size_t axis) const {
  Direction& direction = directions_[axis];
  std::call_once(direction.made, [&] { make(axis, direction); });
  return direction.volume;
}

void RayVoxels::make(std::size_t axis, Direction& direction) const {
  const auto column_axis = static_cast<std::size_t>(kColumnAxis[axis]),
             row_axis = static_cast<std::size_t>(kRowAxis[axis]);
  const std::array<std::size_t, 3> strides{1, grid_.size[0], grid_.size[0] * grid_.size[1]};
  const std::size_t columns = grid_.size[column_axis], rows = grid_.size[row_axis], planes = grid_.size[axis];
  // One empty column before and two behind, of which the last is only ever the neighbour of the one before.
  const std::size_t plane_stride = columns + 3, row_stride = plane_stride * (planes + 2);
  direction.quads = empty_elements(row_stride * (rows + 2));
  std::uint32_t* const quads = direction.quads.get();
  // Row r of the elements is row r - 1 of the voxels.
  for_each_part(rows + 2, threads_, [&](std::size_t r) {
    std::uint32_t* const to = quads + r * row_stride;
    std::memset(to, 0, row_stride * sizeof *to);
    const std::uint16_t* const here = r >= 1 && r <= rows ? &steps_[(r - 1) * strides[row_axis]] : nullptr;
    const std::uint16_t* const next = r < rows ? &steps_[r * strides[row_axis]] : nullptr;
    // Some planes at a time, so that what is read or written across the order of memory stays in the cache.
    constexpr std::size_t kPlanes = 16;
    for (std::size_t begin = 0; begin < planes; begin += kPlanes) {
      for (std::size_t column = 0; column < columns; ++column) {
        for (std::size_t plane = begin; plane < std::min(begin + kPlanes, planes); ++plane) {
          const std::size_t from = column * strides[column_axis] + plane * strides[axis];
          const std::uint32_t low = here != nullptr ? here[from] : 0, high = next != nullptr ? next[from] : 0;
          to[(plane + 1) * plane_stride + column + 1] = low | high << 16U;
        }
      }
    }
  });
  direction.volume = {quads,
                      static_cast<std::int32_t>(row_stride),
                      static_cast<std::int32_t>(plane_stride),
                      static_cast<float>(columns + 1),
                      static_cast<float>(rows + 1),
                      static_cast<std::int32_t>(planes + 1)};
}

}  // namespace kiroku::sim
