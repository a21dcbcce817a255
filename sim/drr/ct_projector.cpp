#include "sim/drr/ct_projector.h"

#include <cmath>

#include "base/error.h"
#include "base/parallel.h"

namespace kiroku::sim {
namespace {

constexpr auto kSide = static_cast<std::size_t>(kTileSide);

struct Tiles {
  std::size_t columns, rows;
  explicit Tiles(const ProjectionGeometry& geometry)
      : columns((geometry.columns() + kSide - 1) / kSide), rows((geometry.rows() + kSide - 1) / kSide) {}
  [[nodiscard]] std::size_t count() const { return columns * rows; }
};

/// Which cells each tile sees, in their order: numbers[begin[tile]] to numbers[begin[tile + 1]].
struct CellsOfTiles {
  std::vector<std::size_t> begin;
  std::vector<std::uint32_t> numbers;
};

CellsOfTiles sort_into(const Tiles& tiles, std::span<const RayCell> cells) {
  CellsOfTiles sorted;
  sorted.begin.assign(tiles.count() + 1, 0);
  const auto for_each_tile = [&](const RayCell& cell, const auto& visit) {
    if (cell.u1 <= cell.u0 || cell.v1 <= cell.v0) return;
    for (std::int32_t row = cell.v0 / kTileSide; row <= (cell.v1 - 1) / kTileSide; ++row) {
      for (std::int32_t column = cell.u0 / kTileSide; column <= (cell.u1 - 1) / kTileSide; ++column) {
        visit(static_cast<std::size_t>(row) * tiles.columns + static_cast<std::size_t>(column));
      }
    }
  };
  for (const RayCell& cell : cells) for_each_tile(cell, [&](std::size_t tile) { ++sorted.begin[tile + 1]; });
  for (std::size_t tile = 0; tile < tiles.count(); ++tile) sorted.begin[tile + 1] += sorted.begin[tile];
  sorted.numbers.resize(sorted.begin.back());
  std::vector<std::size_t> next(sorted.begin.begin(), sorted.begin.end() - 1);
  for (std::uint32_t number = 0; number < cells.size(); ++number) {
    for_each_tile(cells[number], [&](std::size_t tile) { sorted.numbers[next[tile]++] = number; });
  }
  return sorted;
}

/// The box of the volume, in elements of its RayVolume: across the planes to the faces of the outermost
/// voxels, within them to where interpolation ends at nothing.
RayCell box_cell(const RayVoxels& voxels, const ProjectionGeometry& geometry,
                 const ProjectionGeometry::PixelRays& rays, std::size_t u0, std::size_t v0) {
  const Grid& grid = voxels.grid();
  RayCell cell;
  cell.u0 = static_cast<std::int32_t>(u0);
  cell.v0 = static_cast<std::int32_t>(v0);
  cell.u1 = static_cast<std::int32_t>(std::min(u0 + kSide, geometry.columns()));
  cell.v1 = static_cast<std::int32_t>(std::min(v0 + kSide, geometry.rows()));
  cell.scale = 1;
  const Vector3 source = grid.index(geometry.source_m()) + Vector3::Ones();
  const auto elements = [&](const Vector3& direction) -> Vector3 {
    return (grid.direction.transpose() * direction).cwiseQuotient(grid.spacing_m);
  };
  const Vector3 along_u = elements(rays.along_row), along_v = elements(rays.down_column);
  const Vector3 corner = elements(rays.corner + double(u0) * rays.along_row + double(v0) * rays.down_column);
  const Vector3 middle =
      corner + 0.5 * double(cell.u1 - cell.u0) * along_u + 0.5 * double(cell.v1 - cell.v0) * along_v;
  Eigen::Index axis = 0;
  middle.cwiseAbs().maxCoeff(&axis);
  cell.axis = static_cast<std::int32_t>(axis);
  const auto at = static_cast<std::size_t>(axis);
  const std::array<Eigen::Index, 3> order{axis, RayVoxels::kColumnAxis[at], RayVoxels::kRowAxis[at]};
  std::vector<std::array<double, 3>> fronts, backs;
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Index of = order[i];
    cell.map[i][0] = static_cast<float>(source[of]);
    cell.map[i][1] = static_cast<float>(corner[of]);
    cell.map[i][2] = static_cast<float>(along_u[of]);
    cell.map[i][3] = static_cast<float>(along_v[of]);
    const double size = static_cast<double>(grid.size[static_cast<std::size_t>(of)]);
    const double low = i == 0 ? 0.5 : 0, high = size + (i == 0 ? 0.5 : 1);
    for (const auto& [sign, bound] : {std::pair{-1.0, low}, {1.0, high}}) {
      // sign (source + t d) <= sign bound
      double room = sign * (bound - source[of]);
      // A face that the source lies in is seen from just inside.
      if (std::abs(room) < 1e-6) room = std::copysign(1e-6, room);
      const double per = sign / room;
      (room < 0 ? fronts : backs).push_back({per * corner[of], per * along_u[of], per * along_v[of]});
    }
  }
  for (const auto* const faces : {&fronts, &backs}) {
    for (const std::array<double, 3>& face : *faces) {
      for (std::size_t i = 0; i < 3; ++i) cell.faces[cell.face_count][i] = static_cast<float>(face[i]);
      ++cell.face_count;
    }
  }
  cell.fronts = static_cast<std::int32_t>(fronts.size());
  return cell;
}

}  // namespace

ProjectionGeometry::PixelRays pixel_rays_of(const ProjectionGeometry& geometry) {
  ProjectionGeometry::PixelRays rays = geometry.pixel_rays();
  // Not the same both ways: faces along diagonals are as common as along rows.
  constexpr double kAlong = 1e-3, kDown = 0.6e-3;
  rays.corner += kAlong * rays.along_row + kDown * rays.down_column;
  return rays;
}

CtProjector::CtProjector(const Volume& volume, const Attenuation& attenuation,
                         const ProjectorOptions& options)
    : options_(options), voxels_(volume, attenuation, options.threads) {
  if (ray_kernel(options.instructions) == nullptr) {
    throw Error("this machine lacks the vector instructions that were asked for");
  }
  for (unsigned corner = 0; corner < 8; ++corner) {
    Vector3 index;
    for (unsigned axis = 0; axis < 3; ++axis) {
      index[axis] = (corner >> axis & 1U) != 0 ? static_cast<double>(volume.grid.size[axis]) - 0.5 : -0.5;
    }
    corners_m_[corner] = volume.grid.patient_m(index);
  }
}

ProjectionImage CtProjector::project(const ProjectionGeometry& geometry) const {
  refuse_unseen(geometry, corners_m_, "the volume");
  const ProjectionGeometry::PixelRays rays = pixel_rays_of(geometry);
  std::vector<RayCell> cells;
  for (std::size_t v = 0; v < geometry.rows(); v += kSide) {
    for (std::size_t u = 0; u < geometry.columns(); u += kSide) {
      cells.push_back(box_cell(voxels_, geometry, rays, u, v));
    }
  }
  return integrate(geometry, cells);
}

ProjectionImage CtProjector::integrate(const ProjectionGeometry& geometry,
                                       std::span<const RayCell> cells) const {
  const Tiles tiles(geometry);
  const CellsOfTiles sorted = sort_into(tiles, cells);
  std::array<RayVolume, 3> volumes;
  std::array<bool, 3> needed{};
  for (const RayCell& cell : cells) needed[static_cast<std::size_t>(cell.axis)] = true;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (needed[axis]) volumes[axis] = voxels_.along(axis);
  }
  const ProjectCells project_cells = ray_kernel(options_.instructions);
  const ProjectionGeometry::PixelRays rays = pixel_rays_of(geometry);
  const double unit = voxels_.step_per_m() / kRayWeight;
  ProjectionImage image{geometry.columns(), geometry.rows(), {}};
  image.values.resize(image.columns * image.rows);
  for_each_part(tiles.count(), options_.threads, [&](std::size_t number) {
    const std::size_t u0 = number % tiles.columns * kSide, v0 = number / tiles.columns * kSide;
    alignas(64) std::array<float, kSide * kSide> tile{};
    project_cells(volumes.data(), cells.data(), sorted.numbers.data() + sorted.begin[number],
                  sorted.begin[number + 1] - sorted.begin[number], static_cast<std::int32_t>(u0),
                  static_cast<std::int32_t>(v0), tile.data());
    for (std::size_t v = v0; v < std::min(v0 + kSide, image.rows); ++v) {
      for (std::size_t u = u0; u < std::min(u0 + kSide, image.columns); ++u) {
        // Integrals are over the depth; a metre of it is so many of the ray.
        const double per_depth =
            (rays.corner + double(u) * rays.along_row + double(v) * rays.down_column).norm();
        image.values[v * image.columns + u] =
            static_cast<float>(double(tile[(v - v0) * kSide + (u - u0)]) * per_depth * unit);
      }
    }
  });
  return image;
}

}  // namespace kiroku::sim
