// The inner loop of projecting: line integrals through convex cells, each of which maps rays into a volume's
// voxels. Written once over a set of vector instructions (ray_kernel_lanes.h) and compiled for several; only
// plain data crosses this border, so that no inline function of another header is compiled with instructions
// that the machine may not have.
//
// A ray of pixel (u, v) is source + t d(u, v), with t the depth. The plane of a face cuts it at an inverse
// depth w = 1 / t that is affine in (u, v), and a cell that does not hold the source is entered at the least
// w of the faces that look to the source and left at the greatest w of the others. Within a cell the ray is a
// straight line in voxels too. It is sampled where it crosses the planes of voxel centres across which it
// runs steepest, with linear interpolation within the plane (Joseph, IEEE Transactions on Medical Imaging
// 1(3), 1982), each sample weighted with the part of the plane's slab that lies in the cell. So parts of a
// ray in neighbouring cells add up to what the whole ray would give.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/instruction_set.h"

namespace kiroku::sim {

/// Pixels are worked on in squares of this side.
inline constexpr int kTileSide = 32;

/// Voxels for rays that run along one axis (the planes'). The element at (column, row, plane) holds the value
/// there in its lower 15 bits and that of the next row in bits 16 to 30, so that eight bytes are the four
/// corners of a cell of the plane. There is an empty border around: voxel (0, 0, 0) is at (1, 1, 1).
struct RayVolume {
  const std::uint32_t* quads = nullptr;
  std::int32_t row_stride = 0, plane_stride = 0;  // elements
  float last_column = 0, last_row = 0;            // up to where may be sampled
  std::int32_t last_plane = 0;
};
/// What the parts of both weights of a pair add up to; integrals are in units of this times the voxels'
/// values.
inline constexpr int kRayWeight = 32767;

/// A convex cell that lies in front of the source, which is outside it. (u, v) count from (u0, v0).
struct RayCell {
  static constexpr int kMostFaces = 6;
  float faces[kMostFaces][3];  // w = [0] + [1] u + [2] v; first those that look to the source
  std::int32_t fronts = 0, face_count = 0;
  std::int32_t u0 = 0, v0 = 0, u1 = 0, v1 = 0;  // pixels that may see it: from (u0, v0), before (u1, v1)
  std::int32_t axis = 0;                        // of its volume, 0 to 2
  /// Of plane, column and row: the source's place and d = [1] + [2] u + [3] v, in elements of the volume.
  float map[3][4];
  float scale = 0;
};

/// Adds to the tile's pixels (rows of kTileSide, from pixel (u, v)) the integrals over t of `count` cells, in
/// their order. `volumes` are three, by axis.
using ProjectCells = void (*)(const RayVolume* volumes, const RayCell* cells, const std::uint32_t* numbers,
                              std::size_t count, std::int32_t u, std::int32_t v, float* tile);

/// Null where the program or the machine lacks it.
ProjectCells ray_kernel(InstructionSet set);

}  // namespace kiroku::sim
