// How well tetrahedra are shaped: what decides how well a solve is conditioned, and how right it is. Pure,
// thread-safe.
#pragma once

#include <map>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

struct RegionMeasures {
  std::size_t tetrahedra = 0;
  double volume_m3 = 0;
};

struct MeshQuality {
  double least_dihedral_deg = 0, greatest_dihedral_deg = 0;  // angles between faces; 70.5 in a regular one
  double median_least_dihedral_deg = 0;                      // of the least angles of each
  std::size_t below_8_deg = 0, below_12_deg = 0;             // tetrahedra with such an angle
  /// Radius of the circumscribed sphere to the shortest edge; 0.61 in a regular one.
  double greatest_radius_edge = 0, median_radius_edge = 0;
  double least_volume_m3 = 0, greatest_volume_m3 = 0, volume_m3 = 0;
  std::map<std::int32_t, RegionMeasures> regions;
};

/// Of at least one tetrahedron, each of positive volume.
MeshQuality measure_quality(const TetMesh& mesh);

/// The six angles between the faces of a tetrahedron, in radians: at the edges 01, 02, 03, 12, 13, 23.
std::array<double, 6> dihedral_angles_rad(const TetMesh& mesh, std::size_t tetrahedron);

}  // namespace kiroku::sim
