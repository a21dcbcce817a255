// Radiographs of a CT that a mesh deforms: what is inside the mesh moves with it, what is outside stays.
#pragma once

#include <span>
#include <vector>

#include "sim/drr/ct_projector.h"
#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

enum class DensityRule {
  kKeepDensity,  // a voxel keeps its attenuation, however its tissue is stretched
  kKeepMass,     // attenuation grows as the volume of an element shrinks: air leaves a lung, tissue does not
};

/// Each tetrahedron maps rays through its deformed place into the CT at its rest shape, so that the CT is
/// never resampled. Immutable; thread-safe.
class MeshProjector {
 public:
  /// The CT must outlive this. kiroku::Error where a node of a tetrahedron lies outside the CT by more than a
  /// voxel, or a tetrahedron has no volume.
  MeshProjector(const CtProjector& ct, TetMesh mesh);

  [[nodiscard]] const TetMesh& mesh() const { return mesh_; }

  /// What the tissue in the mesh gives alone, deformed; `displacement_m` (|V|). kiroku::Error for another
  /// count, for what is no number or out of the room, and where the source would be inside. Tetrahedra
  /// without volume give nothing, those turned inside out what they would the right way round.
  [[nodiscard]] ProjectionImage inside(const ProjectionGeometry& geometry,
                                       std::span<const Vector3> displacement_m,
                                       DensityRule rule = DensityRule::kKeepDensity) const;
  /// What is outside of the mesh at rest: the whole CT less what is inside, ray by ray, so that voxels that
  /// the surface goes through count on both sides by the part that they have there. It stays the same while
  /// the mesh moves: a film computes it once.
  [[nodiscard]] ProjectionImage outside(const ProjectionGeometry& geometry) const;
  /// Both together; never negative.
  [[nodiscard]] ProjectionImage project(const ProjectionGeometry& geometry,
                                        std::span<const Vector3> displacement_m,
                                        DensityRule rule = DensityRule::kKeepDensity) const;

 private:
  const CtProjector& ct_;
  TetMesh mesh_;
  std::vector<std::uint32_t> order_;  // of tetrahedra: near each other, one after the other
  std::vector<Vector3> elements_;     // (|V|), where each node is in the voxels, in elements of a RayVolume
};

/// Adds, and takes for nothing what rounding left below.
void add_to(ProjectionImage& image, const ProjectionImage& more);

}  // namespace kiroku::sim
