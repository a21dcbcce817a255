// Radiographs of a CT that a mesh deforms, by OpenGL: the texture-based projector.
//
// Source: "Simulating Lung Tumor Motion for Dynamic Tumor-tracking Irradiation": displaced tetrahedra are
// drawn with their initial coordinates as texture coordinates and added up. Here each tetrahedron gives each
// pixel the mean of the attenuation at points along the ray within it, no more than `spacing_m` apart, times
// the ray's way through it. Sums need no order.
#pragma once

#include <memory>
#include <span>

#include "sim/drr/mesh_projector.h"
#include "sim/render/gl_context.h"

namespace kiroku::sim {

/// What the tissue in the mesh gives; what is outside of it stays, see MeshProjector::outside(). Belongs to
/// the thread that made it. In software the same input gives the same bits, whatever the number of threads.
class GlProjector {
 public:
  /// The volume is not needed afterwards. `spacing_m` 0: half of the least voxel spacing. kiroku::Error as
  /// choose_context(), and for a CT that the driver cannot hold.
  GlProjector(
      const Volume& volume, const Attenuation& attenuation, TetMesh mesh, GpuUse use, double spacing_m = 0,
      const GpuMaker& make_gpu = [] { return make_gpu_context(); });
  ~GlProjector();
  GlProjector(const GlProjector&) = delete;
  GlProjector& operator=(const GlProjector&) = delete;

  /// As MeshProjector::inside(): `displacement_m` (|V|); kiroku::Error for another count, for what is not
  /// finite, where a part of the mesh is not in front of the source, and where the driver fails.
  ProjectionImage inside(const ProjectionGeometry& geometry, std::span<const Vector3> displacement_m,
                         DensityRule rule = DensityRule::kKeepDensity);

  /// As the driver names itself.
  [[nodiscard]] const std::string& renderer() const;
  /// Why the graphics processor is not used, where one is there and failed; else empty.
  [[nodiscard]] const std::string& notice() const { return notice_; }

 private:
  class Drawing;

  TetMesh mesh_;
  std::vector<Vector3> texture_;  // (|V|), the initial coordinates
  double spacing_m_;
  std::string notice_;
  std::unique_ptr<Drawing> drawing_;
};

}  // namespace kiroku::sim
