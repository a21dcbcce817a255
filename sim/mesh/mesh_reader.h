// Tetrahedral meshes from files: MSH 2.2 and 4.1 (Gmsh), legacy VTK, VEG (VegaFEM). Functions are pure but
// for the file that read_mesh() opens, and thread-safe.
//
// Nodes are numbered from 0 in the order of the file. Regions are: in MSH the physical group of the volume
// (the elementary entity where no tetrahedron has one); in VTK the cell data "region", "regions", "material",
// "label", "labels", "gmsh:physical", "medit:ref" or "CellEntityIds", whichever is there first, else 0; in
// VEG the *REGION statements, counted from 1, a later one wins, 0 for elements of none.
//
// kiroku::Error in one sentence with file, line (byte in binary files) and what was wrong: truncated files,
// counts larger than the file, nodes that are not there, numbers that are not finite, versions and kinds of
// data sets that are not read. Whether the mesh is sound is mesh_check's business.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sim/mesh/length_unit.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

struct MeshFile {
  TetMesh mesh;  // at least one tetrahedron
  /// Cells that are no 4-node tetrahedra ("triangles"), and how many; in the order first met.
  std::vector<std::pair<std::string, std::size_t>> dropped;
  /// The file counts the corners of every tetrahedron the other way round (volumes negative throughout), so
  /// the last two of each were swapped.
  bool turned = false;
};

/// By the file's ending: .msh, .vtk, .veg. Also throws kiroku::IoError, and kiroku::UsageError for another
/// ending.
MeshFile read_mesh(const std::filesystem::path& file, LengthUnit unit);

/// The whole of a regular file. kiroku::IoError, kiroku::UsageError.
std::string read_mesh_text(const std::filesystem::path& file);

/// `name` stands in errors.
MeshFile parse_msh(std::string_view file, const std::string& name, LengthUnit unit);
MeshFile parse_vtk(std::string_view file, const std::string& name, LengthUnit unit);
MeshFile parse_veg(std::string_view file, const std::string& name, LengthUnit unit);

}  // namespace kiroku::sim
