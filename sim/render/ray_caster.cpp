#include "sim/render/ray_caster.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <thread>

#include "base/error.h"
#include "base/parallel.h"
#include "sim/mesh/length_unit.h"
#include "sim/render/colour_map.h"
#include "sim/render/picture_squares.h"
#include "sim/render/tip_lighting.h"

namespace kiroku::sim {
namespace {

// How opaque a cell may be, as a byte: steps of a tenth of an octave from here on, which reach beyond the
// most opaque that there is.
constexpr double kLeastExtinction = 1e-6, kStepsPerOctave = 10;

std::uint8_t opacity_byte(float extinction_per_mm) {
  if (!(extinction_per_mm > 0)) return 0;
  const double step =
      1 + std::ceil(kStepsPerOctave * std::log2(double{extinction_per_mm} / kLeastExtinction));
  return static_cast<std::uint8_t>(std::clamp(step, 1.0, 255.0));
}
/// The greatest byte that stands for no more than this; 0 where none does.
std::int32_t greatest_byte(double extinction_per_mm) {
  const double step = 1 + std::floor(kStepsPerOctave * std::log2(extinction_per_mm / kLeastExtinction));
  return static_cast<std::int32_t>(std::clamp(step, 0.0, 254.0));
}

/// The greatest of any stretch of a list, in two look-ups.
class GreatestWithin {
 public:
  explicit GreatestWithin(std::vector<std::uint8_t> values) : levels_{std::move(values)} {
    for (std::size_t reach = 1; 2 * reach <= levels_[0].size(); reach *= 2) {
      const std::vector<std::uint8_t>& last = levels_.back();
      std::vector<std::uint8_t> level(levels_[0].size());
      for (std::size_t i = 0; i + 2 * reach <= level.size(); ++i)
        level[i] = std::max(last[i], last[i + reach]);
      levels_.push_back(std::move(level));
    }
  }
  [[nodiscard]] std::uint8_t of(std::size_t first, std::size_t last) const {
    const auto number = static_cast<std::size_t>(std::bit_width(last - first + 1) - 1);
    const std::vector<std::uint8_t>& level = levels_[number];
    return std::max(level[first], level[last + 1 - (std::size_t{1} << number)]);
  }

 private:
  std::vector<std::vector<std::uint8_t>> levels_;  // level n: of 2^n from each on
};

std::string name_of(InstructionSet set) {
  return set == InstructionSet::kAvx512 ? "AVX-512" : set == InstructionSet::kAvx2 ? "AVX2" : "baseline";
}

}  // namespace

RayCaster::RayCaster(std::shared_ptr<const ShadedVolume> volume, const TransferFunction& transfer,
                     const RayCasterOptions& options)
    : volume_(std::move(volume)),
      transfer_(transfer),
      threads_(options.threads > 0 ? options.threads : std::max(std::thread::hardware_concurrency(), 1U)),
      march_(march_rays(options.instructions)),
      name_("processor, " + std::to_string(threads_) + (threads_ == 1 ? " thread, " : " threads, ") +
            name_of(options.instructions)) {
  if (march_ == nullptr)
    throw UsageError("this machine has no " + name_of(options.instructions) +
                     ": take another set of instructions");
  if (volume_->texels.size() / 4 >= std::size_t{std::numeric_limits<std::int32_t>::max()}) {
    throw Error(
        "the CT has more voxels than the ray caster can hold (2147483647): show a smaller part of it "
        "with --mesh");
  }
  constexpr int kTintColours = 256;
  for (int i = 0; i < kTintColours; ++i) {
    for (const std::uint8_t part : viridis(i / double{kTintColours - 1}))
      tint_colours_.push_back(static_cast<float>(part) / 255);
    tint_colours_.push_back(1);
  }
  linear_tint_colours_ = tint_colours_;
  for (std::size_t i = 0; i < linear_tint_colours_.size(); ++i) {
    float& part = linear_tint_colours_[i];
    if (i % 4 < 3) part = static_cast<float>(linear_light(double{part}));
  }
  measure_opacity();
}

void RayCaster::measure_opacity() {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(transfer_.entries.size());
  for (const TransferFunction::Entry& entry : transfer_.entries)
    bytes.push_back(opacity_byte(entry.extinction_per_mm));
  const GreatestWithin greatest(std::move(bytes));
  const auto& size = volume_->size;
  std::array<std::size_t, 3> blocks{};
  for (std::size_t axis = 0; axis < 3; ++axis) blocks[axis] = (size[axis] + 1) / 2;
  const std::size_t row = size[0], plane = row * size[1];
  opacity_.assign(blocks[0] * blocks[1] * blocks[2], 0);
  for_each_part(blocks[2], threads_, [&](std::size_t k) {
    std::vector<std::array<std::uint16_t, 2>> columns(row);
    for (std::size_t j = 0; j < blocks[1]; ++j) {
      columns.assign(row, {65535, 0});
      for (std::size_t z = 2 * k; z < std::min(2 * k + 3, size[2]); ++z) {
        for (std::size_t y = 2 * j; y < std::min(2 * j + 3, size[1]); ++y) {
          const std::uint16_t* const hu = volume_->texels.data() + 4 * (plane * z + row * y) + 3;
          for (std::size_t i = 0; i < row; ++i)
            columns[i] = {std::min(columns[i][0], hu[4 * i]), std::max(columns[i][1], hu[4 * i])};
        }
      }
      for (std::size_t i = 0; i < blocks[0]; ++i) {
        std::uint32_t least = 65535, most = 0;
        for (std::size_t x = 2 * i; x < std::min(2 * i + 3, row); ++x) {
          least = std::min<std::uint32_t>(least, columns[x][0]);
          most = std::max<std::uint32_t>(most, columns[x][1]);
        }
        // The entries that samples round to, and one more each way.
        const auto entry = [](std::uint32_t texel) { return (texel * 4095U + 32767U) / 65535U; };
        const std::size_t first = std::max(entry(least), 1U) - 1U;
        const std::size_t last = std::min<std::size_t>(entry(most) + 1U, kHuEntries - 1);
        opacity_[(k * blocks[1] + j) * blocks[0] + i] = greatest.of(first, last);
      }
    }
  });
}

void RayCaster::set_mesh(const PlacedMesh& mesh) {
  cells_.assign(mesh.topology.cells.size(), MarchCell{});
  for (std::size_t number = 0; number < cells_.size(); ++number) {
    MarchCell& cell = cells_[number];
    const CellLinks& links = mesh.topology.cells[number];
    for (std::size_t corner = 0; corner < 4; ++corner) {
      const std::uint32_t beyond = links.neighbours[corner];
      cell.beyond[corner] = kMarchNone;
      if (beyond == kNoCell) continue;
      const auto& back = mesh.topology.cells[beyond].neighbours;
      const auto face = std::ranges::find(back, static_cast<std::uint32_t>(number)) - back.begin();
      cell.beyond[corner] = 4 * beyond + static_cast<std::uint32_t>(face);
    }
    cell.hidden = (links.nodes[0] & kEmptyCell) != 0 ? 1 : 0;
    std::array<Vector3, 4> corners;
    for (std::size_t corner = 0; corner < 4; ++corner)
      corners[corner] = mesh.rest.nodes[mesh.rest.tetrahedra[number][corner]];
    const std::array<float, 2> range = hu_range(*volume_, corners);
    // The entries that samples round to, and one more each way.
    const auto entry = [](double hu) {
      return static_cast<std::ptrdiff_t>(std::clamp(hu - kLeastHu, 0.0, double(kHuEntries) - 1));
    };
    const auto first = transfer_.entries.begin() + entry(std::floor(double{range[0]}) - 1);
    const auto last = transfer_.entries.begin() + entry(std::ceil(double{range[1]}) + 1) + 1;
    cell.least_opacity =
        opacity_byte(std::ranges::min_element(first, last, {}, &TransferFunction::Entry::extinction_per_mm)
                         ->extinction_per_mm);
  }
}

void RayCaster::place_cells(const PlacedMesh& mesh, const Scene& scene) {
  for (std::size_t number = 0; number < cells_.size(); ++number) {
    MarchCell& cell = cells_[number];
    const CellGeometry& geometry = mesh.cells[number];
    const CellLinks& links = mesh.topology.cells[number];
    const std::array<std::uint32_t, 4> nodes{links.nodes[0] & ~kEmptyCell, links.nodes[1], links.nodes[2],
                                             links.nodes[3]};
    std::array<Float4, 4> turn;
    for (std::size_t corner = 0; corner < 4; ++corner) {
      turn[corner] = mesh.rotations4[nodes[corner]];
      // Quaternions of one rotation have two signs: those of the corner 0 decide.
      float same = 0;
      for (std::size_t c = 0; c < 4; ++c) same += turn[0][c] * turn[corner][c];
      if (same < 0) {
        for (float& c : turn[corner]) c = -c;
      }
    }
    for (std::size_t column = 0; column < 4; ++column) {
      float* const corner = cell.corner[column];
      corner[0] = column == 3 ? 1.0F : 0.0F;
      for (std::size_t c = 0; c < 3; ++c) {
        corner[c + 1] = geometry.barycentric[c][column];
        corner[0] -= corner[c + 1];
        cell.voxel[column][c] =
            geometry.texture[c][column] * static_cast<float>(volume_->size[c]) - (column == 3 ? 0.5F : 0.0F);
      }
      cell.voxel[column][3] = 0;
      for (std::size_t c = 0; c < 4; ++c) {
        cell.turn[column][c] =
            corner[0] * turn[0][c] + corner[1] * turn[1][c] + corner[2] * turn[2][c] + corner[3] * turn[3][c];
      }
      cell.tint[column] = 0;
      for (std::size_t c = 0; scene.stress && c < 4; ++c) {
        cell.tint[column] +=
            corner[c] * static_cast<float>(scene.stress->at_nodes_pa[nodes[c]] / scene.stress->largest_pa);
      }
    }
  }
}

double RayCaster::faint_share(const PlacedMesh& mesh, const Scene& scene) {
  if (scene.moving) return kMovingFaint;
  if (!scene.tip_light) return kFaint;
  constexpr double kLeastMm = 1;
  const double nearest_m = std::max(mesh.nearest_mm, kLeastMm) / kMmPerM;
  return kTipFaint / std::max(1.0, std::pow(scene.tip_light->working_distance_m / nearest_m, 2));
}

/// The table for segments of such a length, computed where it is not at hand. Valid until the next call.
const Preintegration& RayCaster::segments_of(double length_mm, bool linear) {
  constexpr std::size_t kKept = 8;
  auto table = std::ranges::find_if(
      tables_, [&](const Table& one) { return one.linear == linear && one.segments.length_mm == length_mm; });
  if (table == tables_.end()) {
    if (tables_.size() == kKept) tables_.pop_back();
    tables_.push_back({linear, preintegrate(transfer_, length_mm, linear)});
    table = tables_.end() - 1;
  }
  std::rotate(tables_.begin(), table, table + 1);
  return tables_.front().segments;
}

MarchScene RayCaster::march_scene(const PlacedMesh& mesh, const Scene& scene, double spacing_m) {
  MarchScene march{};
  const Preintegration& segments = segments_of(spacing_m * kMmPerM, scene.tip_light.has_value());
  march.volume = {volume_->texels.data(),  opacity_.data(),         {}, {},
                  segments.node_of.data(), segments.segments.data()};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    march.volume.size[axis] = static_cast<std::int32_t>(volume_->size[axis]);
    march.volume.blocks[axis] = (march.volume.size[axis] + 1) / 2;
  }
  march.cells = cells_.data();
  const Camera& camera = scene.camera;
  const double scale = camera.parallel ? kMmPerM : 1;
  for (int axis = 0; axis < 2; ++axis) {
    march.half_extent[axis] = static_cast<float>(scale * camera.half_extent[axis]);
    march.centre[axis] = static_cast<float>(scale * camera.centre[axis]);
  }
  march.one_over_size[0] = 1 / static_cast<float>(scene.width);
  march.one_over_size[1] = 1 / static_cast<float>(scene.height);
  march.height = scene.height;
  march.parallel = camera.parallel ? 1 : 0;
  const double spacing_mm = spacing_m * kMmPerM;
  march.spacing_mm = static_cast<float>(spacing_mm);
  march.ambient = static_cast<float>(transfer_.ambient);
  march.diffuse = static_cast<float>(transfer_.diffuse);
  march.specular = static_cast<float>(transfer_.specular);
  march.shininess = static_cast<float>(transfer_.shininess);
  const auto [flat, steep] = transfer_.edge_hu_per_mm;
  march.edge_from = static_cast<float>(flat);
  march.edge_scale = static_cast<float>(1 / (steep - flat));
  constexpr double kStep = kGreatestGradientHuPerMm / 32767;
  march.gradient_scale = static_cast<float>(kStep);
  march.gradient_zero = static_cast<float>(32768 * kStep);
  const Vector3 light = scene.to_light.normalized();
  for (int axis = 0; axis < 3; ++axis) march.light[axis] = static_cast<float>(light[axis]);
  for (int level = 0; level < 3; ++level) {
    const double sections = double(2 << level), faint = faint_share(mesh, scene);
    march.sparse[level] = greatest_byte(-std::log2(1 - faint) / (sections * spacing_mm));
  }
  // Where numbers are linear in light, what is dark has finer steps.
  const double still = scene.tip_light ? kTipEnded : kEnded;
  const double ended = scene.moving ? kMovingEnded : still;
  march.ended_share = static_cast<float>(ended);
  march.ended_extinction = static_cast<float>(-std::log2(ended));
  march.tinted = scene.stress ? 1 : 0;
  march.tint_colours = scene.tip_light ? linear_tint_colours_.data() : tint_colours_.data();
  march.tint_share = scene.stress ? static_cast<float>(scene.stress->share) : 0;
  march.sheeted = scene.surface ? 1 : 0;
  if (scene.surface) {
    for (std::size_t c = 0; c < 3; ++c) {
      march.sheet[c] = static_cast<float>(scene.surface->colour[c]) / 255;
      if (scene.tip_light) march.sheet[c] = static_cast<float>(linear_light(double{march.sheet[c]}));
    }
    march.sheet[3] = static_cast<float>(scene.surface->opacity);
  }
  if (scene.tip_light) {
    const TipLight& tip = *scene.tip_light;
    march.tip = 1;
    for (int axis = 0; axis < 3; ++axis) march.light[axis] = static_cast<float>(tip.at_m[axis] * kMmPerM);
    march.tip_power = static_cast<float>(std::pow(tip.working_distance_m * kMmPerM, 2));
    march.wet = static_cast<float>(tip.wet);
    march.film_spread = static_cast<float>(std::pow(tip.roughness, 4));
    march.film_reflectance = static_cast<float>(kWaterReflectance);
    march.gamma = static_cast<float>(kPictureGamma);
    march.one_over_gamma = static_cast<float>(1 / kPictureGamma);
  }
  const double distance_mm = (std::max(mesh.nearest_mm, 0.0) + mesh.farthest_mm) / 2;
  const double reach = scene.lens ? scene.lens->lens().reach() : camera.half_extent.maxCoeff();
  const double pixel_mm =
      2 * reach / std::min(scene.width, scene.height) * (camera.parallel ? kMmPerM : distance_mm);
  const bool is_fine = scene.moving || pixel_mm < volume_->spacing_m * kMmPerM;
  const double alike = scene.moving ? kMovingAlike : kAlike;
  march.likeness = is_fine ? static_cast<float>(alike / 255) : 0;
  march.stride = scene.moving ? 4 : 2;
  return march;
}

Picture RayCaster::draw(const PlacedMesh& mesh, const Scene& scene, double spacing_m) {
  place_cells(mesh, scene);
  const MarchScene march = march_scene(mesh, scene, spacing_m);
  const PictureSquares squares(mesh, scene);
  Picture picture(scene.width, scene.height);
  const auto draw_square = [&](std::size_t number) {
    const std::unique_ptr<PictureSquare> square = squares.square(number);
    const MarchTile tile{square->x0,
                         square->y0,
                         square->x1,
                         square->y1,
                         square->entries.data(),
                         square->layers.data(),
                         square->end_mm.data(),
                         scene.lens ? square->slopes.data() : nullptr,
                         square->colour.data()};
    march_(march, tile);
    for (int y = tile.y0; y < tile.y1; ++y) {
      const float* colour = square->colour.data() + 3 * std::size_t(y - tile.y0) * kMarchTile;
      std::uint8_t* const to = picture.pixel(tile.x0, y);
      for (int i = 0; i < 3 * (tile.x1 - tile.x0); ++i)
        to[i] = static_cast<std::uint8_t>(std::clamp(colour[i], 0.0F, 1.0F) * 255 + 0.5F);
    }
  };
  for_each_part(squares.count(), threads_, draw_square);
  return picture;
}

}  // namespace kiroku::sim
