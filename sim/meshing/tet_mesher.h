// Tetrahedra from labelled voxels, by Delaunay refinement: CGAL's Mesh_3 (Jamin, Alliez, Yvinec, Boissonnat,
// "CGALmesh: a generic framework for Delaunay mesh generation", ACM TOMS 41(4), 2015).
//
// One translation unit knows CGAL: it takes most of a minute and 3 GB to compile.
#pragma once

#include <memory>

#include "sim/volume/volume.h"

namespace kiroku::sim {

/// A body of labelled voxels, to be meshed with cells of one size after another. Everything runs on the
/// calling thread, in one order: CGAL's parallel meshing depends on how threads happen to interleave. Not
/// thread-safe; two meshers may run at the same time.
class TetMesher {
 public:
  /// Label 0 is outside; others are the regions of the mesh, each once for all parts that have it. A point's
  /// region is the label with the greatest trilinear weight of the eight voxels around it, so surfaces run
  /// between voxels and regions meet without gaps. The volume's border is a surface: what is cut off there
  /// gets a flat end. kiroku::Error where no voxel is labelled, or more than kMostRegions labels are used.
  explicit TetMesher(const LabelMap& regions);
  ~TetMesher();
  TetMesher(const TetMesher&) = delete;
  TetMesher& operator=(const TetMesher&) = delete;

  static constexpr std::size_t kMostRegions = 255;

  /// Refines until tetrahedra are no larger than `cell_m` (circumscribed sphere) and the surface is that
  /// close to the body's, see .cpp for the criteria; slivers are still in it. Ends early beyond `most_nodes`.
  /// Nodes are in patient coordinates, numbered in the order in which tetrahedra name them.
  TetMesh refine(double cell_m, std::size_t most_nodes);

  /// The mesh refined last with its slivers perturbed, then exuded, as far as can be, towards no dihedral
  /// angle below `angle_deg`. May be called once after each refine().
  TetMesh optimise(double angle_deg);

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace kiroku::sim
