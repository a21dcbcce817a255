// The inner loop of the ray caster on the processor: the rays of one tile of a picture, from tetrahedron to
// tetrahedron. Written once (ray_march_lanes.h) and compiled for several sets of vector instructions, which
// all give the same bits. Only plain data crosses this border, so that no inline function of another header
// is compiled with instructions that the machine may not have.
//
// Everything within a tetrahedron is affine in the place. So along a ray it is begin + t * slope, with t the
// depth along the view in mm, and each cross-section costs one multiplication and one addition a number. A
// sample is the end of a segment that begins at the sample before.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/instruction_set.h"

namespace kiroku::sim {

/// Pixels are worked on in squares of this side.
inline constexpr int kMarchTile = 16;
/// Layers of surface that a pixel remembers.
inline constexpr int kMarchLayers = 12;
inline constexpr std::uint32_t kMarchNone = 0xFFFFFFFF;

/// A tetrahedron. Affine functions of a place in the view's axes, mm: [x, y, z, 1][which number].
struct alignas(64) MarchCell {
  float corner[4][4];  // barycentric coordinates
  float voxel[4][4];   // the place in the CT: texels' centres are whole numbers; the fourth is unused
  float turn[4][4];    // the rotation as a quaternion (x, y, z, w), of any length
  float tint[4];       // the number that the tint shows, one from 0 to 1: [x, y, z, 1]
  /// Beyond the face opposite each corner: 4 * the neighbour + the corner opposite that face there;
  /// kMarchNone where the surface is.
  std::uint32_t beyond[4];
  std::uint32_t hidden;         // 1: nothing in it can be seen
  std::uint32_t least_opacity;  // no block of the CT within has a lesser MarchVolume::opacity
};

/// The CT. Texels as of ShadedVolume. Between the centres of eight texels lies a cell; cells 2i and 2i + 1
/// along each axis are a block.
struct MarchVolume {
  const std::uint16_t* texels;
  /// (blocks): how opaque the most opaque of a block may be; 0 for what cannot be seen.
  const std::uint8_t* opacity;
  std::int32_t size[3], blocks[3];
  const std::uint8_t* node_of;  // (4096); as preintegration.h has them
  const std::uint16_t* segments;
};

struct MarchScene {
  MarchVolume volume;
  const MarchCell* cells;
  float half_extent[2], centre[2];  // of the camera, at distance 1; mm where parallel
  float one_over_size[2];
  std::int32_t height;
  std::int32_t parallel;
  float spacing_mm;  // between cross-sections
  float ambient, diffuse, specular, shininess;
  float edge_from, edge_scale;               // HU per mm; 1 over the width of the ramp
  float gradient_scale, gradient_zero;       // HU per mm = texel * scale - zero
  float light[3];                            // towards it, of length 1; where it is, mm, if it is at the tip
  std::int32_t tip;                          // 1: as tip_lighting.h has it, linear in light
  float tip_power;                           // its brightness at 1 mm
  float wet, film_spread, film_reflectance;  // share, a^2 and F0 of the film
  float gamma, one_over_gamma;
  /// The greatest MarchVolume::opacity of which a cell is sampled on every second, fourth and eighth
  /// cross-section alone.
  std::int32_t sparse[3];
  std::int32_t tinted;        // 1: colours are tinted by MarchCell::tint
  const float* tint_colours;  // (256 x 4)
  float tint_share;
  std::int32_t sheeted;                 // 1: the surface is a thin sheet
  float sheet[4];                       // its colour and opacity
  float ended_share, ended_extinction;  // what comes through a ray that counts as ended, and what leaves that
  /// Pixels between others that differ by no more than this in any colour (of 0 to 1) are not cast but are
  /// between them in colour; 0: none.
  float likeness;
  std::int32_t stride;  // a power of two: between the pixels that are cast first
};

/// Pixels [x0, x1) x [y0, y1), rows from the top; numbered kMarchTile a row from (x0, y0).
struct MarchTile {
  std::int32_t x0, y0, x1, y1;
  /// (kMarchTile^2 x kMarchLayers): 4 * the cell + the corner opposite the face of entry, from the nearest
  /// on.
  const std::uint32_t* entries;
  const std::uint8_t* layers;  // (kMarchTile^2)
  const float* end_mm;         // (kMarchTile^2): depth of what is opaque; 1e30 for none
  const float* slopes;         // (kMarchTile^2 x 2): of rays that a lens bends; null for the camera's own
  float* colour;               // (kMarchTile^2 x 3): what is behind, and then what is seen
};

using MarchRays = void (*)(const MarchScene& scene, const MarchTile& tile);
/// Null where the program or the machine lacks it.
MarchRays march_rays(InstructionSet set);

}  // namespace kiroku::sim
