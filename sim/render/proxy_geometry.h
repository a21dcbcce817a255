// The proxy geometry of a deformed volume: its tetrahedra as rays find their way through them. Functions are
// pure and thread-safe.
//
// Source: section 3 of "Interactive Volume Manipulation for Supporting Preoperative Planning": cross-sections
// of the displaced tetrahedra, perpendicular to the view, with the initial coordinates of their vertices as
// texture coordinates. Here a ray is followed from tetrahedron to tetrahedron and meets the same
// cross-sections one after the other, nearest first.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "sim/mesh/mesh_topology.h"
#include "sim/render/camera.h"

namespace kiroku::sim {

inline constexpr std::uint32_t kNoCell = 0xFFFFFFFF;
/// Of a cell's first node: nothing in the cell can be seen.
inline constexpr std::uint32_t kEmptyCell = 0x80000000;

/// What stays while a mesh deforms. As shaders read it.
struct CellLinks {
  std::array<std::uint32_t, 4> neighbours;  // beyond the face opposite each corner; kNoCell for none
  std::array<std::uint32_t, 4> nodes;
};
/// A face of the surface: its nodes, anticlockwise from outside, and 4 * cell + the corner opposite.
struct EntryFace {
  std::array<std::uint32_t, 3> nodes;
  std::uint32_t cell_and_corner;
};
struct ProxyTopology {
  std::vector<CellLinks> cells;  // (|T|)
  std::vector<EntryFace> surface;
};
/// kiroku::Error for a face that more than two tetrahedra share.
ProxyTopology proxy_topology(const TetMesh& mesh);

/// Where a cell is: affine functions of a point in view coordinates, mm. As shaders read it.
struct CellGeometry {
  /// Barycentric coordinates of corners 1 to 3; that of corner 0 is what is left to 1.
  std::array<std::array<float, 4>, 3> barycentric;
  std::array<std::array<float, 4>, 3> texture;
};
/// `positions_mm`: of the nodes, in view coordinates; `texture`: their initial coordinates in the texture. A
/// cell without volume gets functions that are zero, which no ray finds a way out of.
void proxy_geometry(std::span<const Tetrahedron> tetrahedra, std::span<const Vector3> positions_mm,
                    std::span<const Vector3> texture, std::vector<CellGeometry>& cells);

}  // namespace kiroku::sim
