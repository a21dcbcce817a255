// The ray kernel over a type of vector lanes; see ray_kernel.h for what it computes. Included once by each
// file that compiles it. Everything here has internal linkage: each file has its own instructions.
//
// Lanes: kWidth; Real and Whole, vectors of so many floats and 32-bit integers; and the functions used below.
#pragma once

#include "sim/drr/ray_kernel.h"

namespace kiroku::sim {
namespace {

/// Where the pixels of a tile that see a cell enter and leave it.
template <typename Lanes>
struct Crossings {
  static constexpr std::size_t kRoom = std::size_t{kTileSide} * kTileSide + Lanes::kWidth;
  alignas(64) float entered[kRoom];
  alignas(64) float left[kRoom];
  alignas(64) std::int32_t pixel[kRoom];
  int count = 0;
};

template <typename Lanes>
inline void find_crossings(const RayCell& cell, std::int32_t tile_u, std::int32_t tile_v,
                           Crossings<Lanes>& found) {
  using Real = typename Lanes::Real;
  const std::int32_t u0 = cell.u0 > tile_u ? cell.u0 : tile_u;
  const std::int32_t v0 = cell.v0 > tile_v ? cell.v0 : tile_v;
  const std::int32_t u1 = cell.u1 < tile_u + kTileSide ? cell.u1 : tile_u + kTileSide;
  const std::int32_t v1 = cell.v1 < tile_v + kTileSide ? cell.v1 : tile_v + kTileSide;
  found.count = 0;
  for (std::int32_t v = v0; v < v1; ++v) {
    for (std::int32_t u = u0; u < u1; u += Lanes::kWidth) {
      const Real along = Lanes::add(Lanes::set(float(u - cell.u0)), Lanes::counting());
      Real entered = Lanes::set(1e30F), left = Lanes::set(-1e30F);
      for (int face = 0; face < cell.face_count; ++face) {
        const float* const w = cell.faces[face];
        const Real at = Lanes::fma(along, Lanes::set(w[1]), Lanes::set(w[0] + w[2] * float(v - cell.v0)));
        if (face < cell.fronts) {
          entered = Lanes::min(entered, at);
        } else {
          left = Lanes::max(left, at);
        }
      }
      const std::int32_t wanted = u1 - u;
      unsigned hit = Lanes::is_less(left, entered);
      if (wanted < Lanes::kWidth) hit &= (1U << unsigned(wanted)) - 1U;
      if (hit == 0) continue;
      const std::int32_t pixel = (v - tile_v) * kTileSide + (u - tile_u);
      found.count += Lanes::append(hit, entered, left, pixel, found.entered + found.count,
                                   found.left + found.count, found.pixel + found.count);
    }
  }
  // Lanes beyond the last are of no length.
  for (int i = found.count; i % Lanes::kWidth != 0; ++i) {
    found.entered[i] = found.left[i] = 1;
    found.pixel[i] = 0;
  }
}

template <typename Lanes>
inline typename Lanes::Real affine(const float* map, typename Lanes::Real u, typename Lanes::Real v) {
  return Lanes::fma(v, Lanes::set(map[3]), Lanes::fma(u, Lanes::set(map[2]), Lanes::set(map[1])));
}

template <typename Lanes>
inline void integrate(const RayVolume& volume, const RayCell& cell, std::int32_t tile_u, std::int32_t tile_v,
                      const Crossings<Lanes>& crossings, float* tile) {
  using Real = typename Lanes::Real;
  using Whole = typename Lanes::Whole;
  const Real half = Lanes::set(0.5F), one = Lanes::set(1.0F), zero = Lanes::set(0.0F);
  const Real last_plane = Lanes::set(float(volume.last_plane)), last_column = Lanes::set(volume.last_column),
             last_row = Lanes::set(volume.last_row);
  const Whole row_stride = Lanes::set(volume.row_stride), plane_stride = Lanes::set(volume.plane_stride);
  const Whole last_offset = Lanes::set(volume.last_plane * volume.plane_stride);
  // The tile's numbers of pixels are the detector's from here.
  const Real from_u = Lanes::set(float(tile_u - cell.u0)), from_v = Lanes::set(float(tile_v - cell.v0));
  for (int at = 0; at < crossings.count; at += Lanes::kWidth) {
    const Whole pixel = Lanes::load(crossings.pixel + at);
    const Real u = Lanes::add(from_u, Lanes::real(Lanes::column_of(pixel)));
    const Real v = Lanes::add(from_v, Lanes::real(Lanes::row_of(pixel)));
    // Depths are bounded, however rounding falls.
    const Real least = Lanes::set(1e-3F);
    const Real t_in = Lanes::divide(one, Lanes::max(Lanes::load(crossings.entered + at), least));
    const Real t_out = Lanes::divide(one, Lanes::max(Lanes::load(crossings.left + at), least));
    const Real across = Lanes::not_near_zero(affine<Lanes>(cell.map[0], u, v));
    const Real inverse = Lanes::divide(one, across);
    const Real column_slope = Lanes::multiply(affine<Lanes>(cell.map[1], u, v), inverse);
    const Real row_slope = Lanes::multiply(affine<Lanes>(cell.map[2], u, v), inverse);
    const Real source = Lanes::set(cell.map[0][0]);
    const Real in = Lanes::fma(t_in, across, source), out = Lanes::fma(t_out, across, source);
    const Real low = Lanes::min(Lanes::max(Lanes::min(in, out), zero), last_plane);
    const Real high = Lanes::min(Lanes::max(Lanes::max(in, out), zero), last_plane);
    const Whole first = Lanes::truncated(Lanes::add(low, half));
    const int planes = 1 + Lanes::greatest(Lanes::subtract(Lanes::truncated(Lanes::add(high, half)), first));
    Real plane = Lanes::real(first);
    const Real from_source = Lanes::subtract(plane, source);
    Real column = Lanes::fma(from_source, column_slope, Lanes::set(cell.map[1][0]));
    Real row = Lanes::fma(from_source, row_slope, Lanes::set(cell.map[2][0]));
    Whole offset = Lanes::multiply(first, plane_stride);
    // The first and the last slab may be partly in the cell, those between are wholly.
    Real sum = zero;
    for (int i = 0; i < planes; ++i) {
      const Real part = Lanes::max(Lanes::subtract(Lanes::min(Lanes::add(plane, half), high),
                                                   Lanes::max(Lanes::subtract(plane, half), low)),
                                   zero);
      // The bound comes second: it is also what becomes of a number that is none.
      const Real c = Lanes::min(Lanes::max(column, zero), last_column);
      const Real r = Lanes::min(Lanes::max(row, zero), last_row);
      const Whole whole_c = Lanes::truncated(c), whole_r = Lanes::truncated(r);
      const Real part_c = Lanes::subtract(c, Lanes::real(whole_c));
      const Whole weights = Lanes::weights(Lanes::subtract(r, Lanes::real(whole_r)));
      const Whole element = Lanes::add(Lanes::add(Lanes::min(offset, last_offset), whole_c),
                                       Lanes::multiply(whole_r, row_stride));
      Whole left, right;
      Lanes::gather(volume.quads, element, left, right);
      const Real at_left = Lanes::real(Lanes::weighted(left, weights));
      const Real at_right = Lanes::real(Lanes::weighted(right, weights));
      sum = Lanes::fma(part, Lanes::fma(part_c, Lanes::subtract(at_right, at_left), at_left), sum);
      plane = Lanes::add(plane, one);
      column = Lanes::add(column, column_slope);
      row = Lanes::add(row, row_slope);
      offset = Lanes::add(offset, plane_stride);
    }
    alignas(64) float sums[Lanes::kWidth];
    Lanes::store(sums,
                 Lanes::multiply(Lanes::multiply(sum, Lanes::magnitude(inverse)), Lanes::set(cell.scale)));
    const int lanes = crossings.count - at < Lanes::kWidth ? crossings.count - at : Lanes::kWidth;
    for (int lane = 0; lane < lanes; ++lane) tile[crossings.pixel[at + lane]] += sums[lane];
  }
}

template <typename Lanes>
void project_cells(const RayVolume* volumes, const RayCell* cells, const std::uint32_t* numbers,
                   std::size_t count, std::int32_t u, std::int32_t v, float* tile) {
  Crossings<Lanes> crossings;
  for (std::size_t i = 0; i < count; ++i) {
    const RayCell& cell = cells[numbers[i]];
    find_crossings<Lanes>(cell, u, v, crossings);
    if (crossings.count > 0) integrate<Lanes>(volumes[cell.axis], cell, u, v, crossings, tile);
  }
}

}  // namespace
}  // namespace kiroku::sim
