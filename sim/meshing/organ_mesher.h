// A mesh for the solver from labelled voxels: as many nodes as were asked for, well-shaped, in one piece.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sim/mesh/tet_mesh.h"
#include "sim/meshing/mesh_cleaning.h"
#include "sim/meshing/mesh_quality.h"
#include "sim/meshing/voxel_parts.h"
#include "sim/volume/volume.h"

namespace kiroku::sim {

struct MeshRequest {
  std::size_t nodes = 5000;  // wanted; met within kNodeTolerance, else said in the findings
  std::size_t pieces = 1;    // parts of the body that are kept, the largest: two for a pair of lungs
};
inline constexpr double kNodeTolerance = 0.15;
inline constexpr std::size_t kLeastNodes = 20, kMostMeshNodes = 2'000'000;
/// Slivers below it are worked on; the least angle of a mesh that is given out is kLeastDihedralDeg.
inline constexpr double kSliverBoundDeg = 12, kLeastDihedralDeg = 8;

struct OrganMesh {
  TetMesh mesh;
  double cell_m = 0;    // the size of cells that led to it
  RemovedParts voxels;  // of labelled voxels that hang together with none of the kept
  Cleaned cleaned;      // of the mesh
  MeshQuality quality;
  std::vector<std::string> findings;  // what a person should know, one sentence each
};

/// `step` is told what is done next ("refining with cells of 8.1 mm"); may be empty.
///
/// Same input, same mesh, to the bit. kiroku::UsageError for a request out of range; kiroku::Error where
/// nothing is labelled, the body is too thin for its voxels, or no mesh without elements below
/// kLeastDihedralDeg was found.
OrganMesh make_organ_mesh(const LabelMap& regions, const MeshRequest& request,
                          const std::function<void(const std::string&)>& step = {});

}  // namespace kiroku::sim
