// Meshes with what was computed on them from VTU files (VTK XML 1.0, unstructured grid, one piece, text
// form), as 'kiroku sim solve' and 'kiroku plan run' write them. Functions are pure but for the file they
// open, and thread-safe.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "sim/mesh/length_unit.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

struct VtuArray {
  std::size_t components = 1;  // values of each node or tetrahedron
  std::vector<double> values;  // (items x components), as the file has them; finite
};

struct VtuFile {
  TetMesh mesh;  // regions from the cell data "region", 0 where there is none
  std::map<std::string, VtuArray> point_data, cell_data;
};

/// kiroku::Error in one sentence with file, line and what was wrong: no VTU, binary or compressed data,
/// counts that do not fit, cells that are no tetrahedra, numbers that are not finite. kiroku::IoError.
VtuFile read_vtu(const std::filesystem::path& file, LengthUnit unit);
/// `name` stands in errors.
VtuFile parse_vtu(std::string_view text, const std::string& name, LengthUnit unit);

/// The point data "displacement" of each of its nodes; (|V|), m. kiroku::Error, naming `name`, where there is
/// none.
std::vector<Vector3> displacement_of(const VtuFile& file, const std::string& name, LengthUnit unit);

/// The point data "displacement" of each node of the mesh that the file was computed on; (|V|), m. The mesh
/// file lies beside it and has the same unit. kiroku::Error where there is none, or the file's nodes are not
/// those of the mesh.
std::vector<Vector3> read_displacement(const std::filesystem::path& file, const TetMesh& mesh,
                                       LengthUnit unit);

}  // namespace kiroku::sim
