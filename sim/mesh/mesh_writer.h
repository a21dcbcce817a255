// Meshes, and what was computed on them, as files' texts: MSH 2.2 (Gmsh) and VTU (ParaView). Functions are
// pure and thread-safe; numbers are written so that reading them gives the same bits.
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "sim/mesh/length_unit.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// Regions become physical groups, with the names that they are given (no quotation marks, no line breaks).
std::string msh_text(const TetMesh& mesh, LengthUnit unit,
                     const std::map<std::int32_t, std::string>& names = {});

/// An array of a VTU file: `components.size()` values (1 where it is empty) for each node or tetrahedron.
struct VtuField {
  std::string name;
  std::vector<std::string> components;  // their names, for ParaView's menus; none for one value
  std::span<const double> values;       // finite; must outlive the call
};

/// An unstructured grid in text form (VTK XML 1.0), cell data "region" always.
std::string vtu_text(const TetMesh& mesh, LengthUnit unit, const std::vector<VtuField>& point_data,
                     const std::vector<VtuField>& cell_data);

}  // namespace kiroku::sim
