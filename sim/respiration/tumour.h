// A tumour as part of a lung mesh, and where it goes. Pure functions, thread-safe.
#pragma once

#include <string>
#include <vector>

#include "sim/mesh/length_unit.h"
#include "sim/mesh/tet_mesh.h"
#include "sim/respiration/mesh_point.h"

namespace kiroku::sim {

/// Elements of the mesh that are tumour.
struct Tumour {
  std::vector<std::uint32_t> tetrahedra;  // ascending, at least one
};
/// Those of a region; kiroku::Error with the regions of the mesh where it has none of that number.
Tumour tumour_of_region(const TetMesh& mesh, std::int32_t region);
/// Those whose centre is in a ball; kiroku::Error where there is none. They keep their material.
Tumour tumour_in_ball(const TetMesh& mesh, const Vector3& centre_m, double radius_m);

double volume_m3(const TetMesh& mesh, const Tumour& tumour);

/// The tumour's centre of mass at rest.
MeshPoint centre_of(const TetMesh& mesh, const Tumour& tumour);

/// Where the tumour is at each time, from its place at rest.
struct TumourPath {
  std::vector<double> times_s;
  std::vector<Vector3> centres_m;
  Vector3 rest_m = Vector3::Zero();
};
/// The greatest distance between two of its places, along x, y and z.
Vector3 excursion_m(const TumourPath& path);

/// "time_s,x_mm,y_mm,z_mm,moved_mm" and a line a time; RFC 4180.
std::string path_csv(const TumourPath& path, LengthUnit unit);

}  // namespace kiroku::sim
