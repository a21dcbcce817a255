#include "sim/render/shaded_volume.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/mesh/length_unit.h"
#include "sim/render/transfer_function.h"

namespace kiroku::sim {
namespace {

constexpr double kHuRange = kGreatestHu - kLeastHu;
// Voxels that are kept around what is asked for: linear interpolation and differences reach one beyond.
constexpr std::ptrdiff_t kMargin = 3;

constexpr double kNoGradient = 32768;

using Index = std::array<std::size_t, 3>;

struct Crop {
  Index first{}, size{};
};

std::string text_of(const Extent& extent) {
  const auto text = [](const Vector3& v) {
    return "(" + number_text(v.x() * kMmPerM, 4) + ", " + number_text(v.y() * kMmPerM, 4) + ", " +
           number_text(v.z() * kMmPerM, 4) + ")";
  };
  return text(extent.least) + " to " + text(extent.greatest) + " mm";
}

template <typename Visit>
void each_corner(const Extent& box, const Visit& visit) {
  for (int corner = 0; corner < 8; ++corner) {
    visit(Vector3((corner & 1) != 0 ? box.greatest.x() : box.least.x(),
                  (corner & 2) != 0 ? box.greatest.y() : box.least.y(),
                  (corner & 4) != 0 ? box.greatest.z() : box.least.z()));
  }
}

Extent box_of(const Grid& grid) {
  Extent box;
  bool first = true;
  const Extent index{
      Vector3::Constant(-0.5),
      Vector3(double(grid.size[0]), double(grid.size[1]), double(grid.size[2])) - Vector3::Constant(0.5)};
  each_corner(index, [&](const Vector3& corner) {
    const Vector3 place = grid.patient_m(corner);
    box.least = first ? place : box.least.cwiseMin(place).eval();
    box.greatest = first ? place : box.greatest.cwiseMax(place).eval();
    first = false;
  });
  return box;
}

Crop crop_of(const Grid& grid, const Extent& box) {
  Vector3 least = Vector3::Constant(1e9), greatest = Vector3::Constant(-1e9);
  each_corner(box, [&](const Vector3& corner) {
    least = least.cwiseMin(grid.index(corner));
    greatest = greatest.cwiseMax(grid.index(corner));
  });
  Crop crop;
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    const auto size = static_cast<std::ptrdiff_t>(grid.size[a]);
    const double first = std::clamp(std::floor(least[axis]) - double{kMargin}, -1e8, 1e8);
    const double last = std::clamp(std::ceil(greatest[axis]) + double{kMargin}, -1e8, 1e8);
    const auto from = std::max<std::ptrdiff_t>(0, static_cast<std::ptrdiff_t>(first));
    const auto to = std::min<std::ptrdiff_t>(size - 1, static_cast<std::ptrdiff_t>(last));
    if (from > to || greatest[axis] < -0.5 || least[axis] > double(size) - 0.5) {
      throw Error("the mesh lies outside its CT: it is at " + text_of(box) + ", the CT at " +
                  text_of(box_of(grid)) +
                  "; look at the mesh's unit (--length-unit) and whether it belongs to this CT");
    }
    crop.first[a] = static_cast<std::size_t>(from);
    crop.size[a] = static_cast<std::size_t>(to - from + 1);
  }
  return crop;
}

/// A Gaussian along one axis; what is beyond the border is as the border.
void smooth_along(std::vector<float>& values, const Index& size, std::size_t axis, double sigma_voxels) {
  const auto reach = static_cast<std::ptrdiff_t>(std::ceil(3 * sigma_voxels));
  std::vector<float> weights;
  double sum = 0;
  for (std::ptrdiff_t i = -reach; i <= reach; ++i)
    sum += std::exp(-0.5 * double(i * i) / (sigma_voxels * sigma_voxels));
  for (std::ptrdiff_t i = -reach; i <= reach; ++i)
    weights.push_back(
        static_cast<float>(std::exp(-0.5 * double(i * i) / (sigma_voxels * sigma_voxels)) / sum));
  const std::size_t stride = axis == 0 ? 1 : axis == 1 ? size[0] : size[0] * size[1];
  const auto length = static_cast<std::ptrdiff_t>(size[axis]);
  std::vector<float> line(size[axis] + 2 * static_cast<std::size_t>(reach));
  const std::size_t lines = values.size() / size[axis];
  for (std::size_t number = 0; number < lines; ++number) {
    const std::size_t begin = number % stride + number / stride * stride * size[axis];
    for (std::ptrdiff_t i = -reach; i < length + reach; ++i) {
      const auto from = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i, 0, length - 1));
      line[static_cast<std::size_t>(i + reach)] = values[begin + from * stride];
    }
    for (std::size_t i = 0; i < size[axis]; ++i) {
      float value = 0;
      for (std::size_t w = 0; w < weights.size(); ++w) value += weights[w] * line[i + w];
      values[begin + i * stride] = value;
    }
  }
}

std::vector<float> smoothed(std::vector<float> values, const Index& size, const Vector3& spacing_m,
                            double sigma_m) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double sigma_voxels = sigma_m / spacing_m[static_cast<Eigen::Index>(axis)];
    // Less than this leaves a neighbour a weight of less than a hundredth.
    if (sigma_voxels > 0.33) smooth_along(values, size, axis, sigma_voxels);
  }
  return values;
}

std::uint16_t encoded(double value, double zero, double scale) {
  return static_cast<std::uint16_t>(std::clamp(std::lround(zero + value * scale), 0L, 65535L));
}

std::uint16_t encoded_hu(float hu) { return encoded(double{hu} - kLeastHu, 0, 65535 / kHuRange); }

/// Into the texels within the layer of air.
void write_texels(ShadedVolume& shaded, const Grid& grid, const Index& size, const std::vector<float>& hu,
                  const std::vector<float>& smooth) {
  const std::array<std::size_t, 3> strides{1, size[0], size[0] * size[1]};
  constexpr double kGradientScale = 32767 / kGreatestGradientHuPerMm;
  const Vector3 spacing_mm = grid.spacing_m * kMmPerM;
  std::size_t voxel = 0;
  for (std::size_t k = 0; k < size[2]; ++k) {
    for (std::size_t j = 0; j < size[1]; ++j) {
      std::uint16_t* texel =
          shaded.texels.data() + 4 * (1 + shaded.size[0] * (j + 1 + shaded.size[1] * (k + 1)));
      for (std::size_t i = 0; i < size[0]; ++i, ++voxel, texel += 4) {
        const Index at{i, j, k};
        Vector3 slope;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const std::size_t back = at[axis] > 0 ? strides[axis] : 0;
          const std::size_t ahead = at[axis] + 1 < size[axis] ? strides[axis] : 0;
          const double distance =
              spacing_mm[static_cast<Eigen::Index>(axis)] * ((back > 0 ? 1 : 0) + (ahead > 0 ? 1 : 0));
          slope[static_cast<Eigen::Index>(axis)] =
              distance > 0 ? (double{smooth[voxel + ahead]} - double{smooth[voxel - back]}) / distance : 0;
        }
        const Vector3 gradient = grid.direction * slope;
        for (int c = 0; c < 3; ++c) texel[c] = encoded(gradient[c], kNoGradient, kGradientScale);
        texel[3] = encoded_hu(hu[voxel]);
      }
    }
  }
}

void measure_blocks(ShadedVolume& shaded, const Index& size, const std::vector<float>& hu) {
  constexpr std::size_t kBlock = ShadedVolume::kBlock;
  for (std::size_t axis = 0; axis < 3; ++axis)
    shaded.blocks[axis] = (shaded.size[axis] + kBlock - 1) / kBlock;
  const auto value = [&](std::size_t i, std::size_t j, std::size_t k) {
    const bool inside = i > 0 && j > 0 && k > 0 && i <= size[0] && j <= size[1] && k <= size[2];
    return inside ? hu[i - 1 + size[0] * (j - 1 + size[1] * (k - 1))] : kAirHu;
  };
  const auto from = [](std::size_t block) { return block == 0 ? 0 : block * kBlock - 1; };
  const auto to = [](std::size_t block, std::size_t all) { return std::min((block + 1) * kBlock + 1, all); };
  shaded.block_hu.reserve(shaded.blocks[0] * shaded.blocks[1] * shaded.blocks[2]);
  for (std::size_t bk = 0; bk < shaded.blocks[2]; ++bk) {
    for (std::size_t bj = 0; bj < shaded.blocks[1]; ++bj) {
      for (std::size_t bi = 0; bi < shaded.blocks[0]; ++bi) {
        std::array<float, 2> range{static_cast<float>(kGreatestHu), static_cast<float>(kLeastHu)};
        for (std::size_t k = from(bk); k < to(bk, shaded.size[2]); ++k) {
          for (std::size_t j = from(bj); j < to(bj, shaded.size[1]); ++j) {
            for (std::size_t i = from(bi); i < to(bi, shaded.size[0]); ++i)
              range = {std::min(range[0], value(i, j, k)), std::max(range[1], value(i, j, k))};
          }
        }
        shaded.block_hu.push_back(range);
      }
    }
  }
}

}  // namespace

ShadedVolume shade(const Volume& volume, const Extent& box, const ShadingOptions& options) {
  const Grid& grid = volume.grid;
  const Crop crop = crop_of(grid, box);
  ShadedVolume shaded;
  shaded.spacing_m = grid.spacing_m.minCoeff();
  shaded.box_m = box_of(grid);
  std::vector<float> hu(crop.size[0] * crop.size[1] * crop.size[2]);
  for (std::size_t k = 0; k < crop.size[2]; ++k) {
    for (std::size_t j = 0; j < crop.size[1]; ++j) {
      const auto row = volume.hu.begin() + static_cast<std::ptrdiff_t>(grid.offset(
                                               crop.first[0], crop.first[1] + j, crop.first[2] + k));
      std::copy_n(row, crop.size[0],
                  hu.begin() + static_cast<std::ptrdiff_t>(crop.size[0] * (j + crop.size[1] * k)));
    }
  }
  if (options.smoothing_m > 0) hu = smoothed(std::move(hu), crop.size, grid.spacing_m, options.smoothing_m);
  for (std::size_t axis = 0; axis < 3; ++axis) shaded.size[axis] = crop.size[axis] + 2;
  const auto none = static_cast<std::uint16_t>(kNoGradient);
  const std::array<std::uint16_t, 4> air{none, none, none, encoded_hu(kAirHu)};
  shaded.texels.resize(4 * shaded.size[0] * shaded.size[1] * shaded.size[2]);
  for (std::size_t at = 0; at < shaded.texels.size(); ++at) shaded.texels[at] = air[at % 4];
  write_texels(shaded, grid, crop.size, hu,
               smoothed(hu, crop.size, grid.spacing_m, options.gradient_smoothing_m));
  measure_blocks(shaded, crop.size, hu);
  // Texel i's centre is at (i + 1/2) / size; texel 0 is of the air.
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    const auto size = double(shaded.size[a]);
    const Eigen::RowVector3d row = grid.direction.col(axis).transpose() / (grid.spacing_m[axis] * size);
    shaded.texture_from_patient_m.block<1, 3>(axis, 0) = row;
    shaded.texture_from_patient_m(axis, 3) = (1.5 - double(crop.first[a])) / size - row.dot(grid.origin_m);
  }
  return shaded;
}

std::array<float, 2> hu_range(const ShadedVolume& volume, std::span<const Vector3, 4> corners_m) {
  Vector3 least = Vector3::Constant(1e9), greatest = Vector3::Constant(-1e9);
  for (const Vector3& corner : corners_m) {
    const Vector3 at = volume.texture_of(corner);
    least = least.cwiseMin(at);
    greatest = greatest.cwiseMax(at);
  }
  std::array<float, 2> range{static_cast<float>(kGreatestHu), static_cast<float>(kLeastHu)};
  std::array<std::size_t, 3> from{}, to{};
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    const auto size = double(volume.size[a]);
    // In voxels, half of one for the rounding of single precision on the way.
    const double first = std::floor(least[axis] * size - 1), last = std::ceil(greatest[axis] * size + 1);
    if (first < 0 || last > size) range = {std::min(range[0], kAirHu), std::max(range[1], kAirHu)};
    const auto block = [&](double voxel) {
      return static_cast<std::size_t>(std::clamp(voxel, 0.0, size - 1)) / ShadedVolume::kBlock;
    };
    from[a] = block(first);
    to[a] = block(last);
  }
  for (std::size_t k = from[2]; k <= to[2]; ++k) {
    for (std::size_t j = from[1]; j <= to[1]; ++j) {
      for (std::size_t i = from[0]; i <= to[0]; ++i) {
        const std::array<float, 2>& block =
            volume.block_hu[i + volume.blocks[0] * (j + volume.blocks[1] * k)];
        range = {std::min(range[0], block[0]), std::max(range[1], block[1])};
      }
    }
  }
  return range;
}

}  // namespace kiroku::sim
