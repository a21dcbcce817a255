// Radiographs computed from a CT (DRRs): for each pixel the integral of the attenuation along the ray from
// the source.
#pragma once

#include <algorithm>
#include <span>
#include <thread>
#include <vector>

#include "sim/drr/projection_geometry.h"
#include "sim/drr/ray_voxels.h"

namespace kiroku::sim {

/// Line integrals of attenuation: dimensionless, before Beer and Lambert's law; finite.
struct ProjectionImage {
  std::size_t columns = 0, rows = 0;
  std::vector<float> values;  // (rows x columns), rows from the head to the feet
};

struct ProjectorOptions {
  unsigned threads = std::max(std::thread::hardware_concurrency(), 1U);
  /// Each gives the same bits whatever the number of threads; between them results differ by some 1e-6.
  InstructionSet instructions = best_instruction_set();
};

/// A CT ready to be projected from anywhere. Immutable; thread-safe.
class CtProjector {
 public:
  /// The volume is not needed afterwards. kiroku::Error for too many voxels.
  CtProjector(const Volume& volume, const Attenuation& attenuation, const ProjectorOptions& options = {});

  [[nodiscard]] const Grid& grid() const { return voxels_.grid(); }
  [[nodiscard]] const RayVoxels& voxels() const { return voxels_; }
  [[nodiscard]] const ProjectorOptions& options() const { return options_; }
  /// The eight corners of its outermost voxels, m.
  [[nodiscard]] const std::array<Vector3, 8>& corners_m() const { return corners_m_; }

  /// The whole CT. kiroku::Error where the source is inside, see refuse_unseen().
  [[nodiscard]] ProjectionImage project(const ProjectionGeometry& geometry) const;

  /// Adds up what the cells give to the rays of a geometry; cells take (u, v) from pixel_rays_of(). Of the
  /// same image whatever the number of threads, as each pixel adds its cells in their order.
  [[nodiscard]] ProjectionImage integrate(const ProjectionGeometry& geometry,
                                          std::span<const RayCell> cells) const;

 private:
  ProjectorOptions options_;
  RayVoxels voxels_;
  std::array<Vector3, 8> corners_m_;
};

/// The rays that are integrated along: a thousandth of a pixel beside the centres of pixels, because a ray
/// that lies within the face between two cells might be taken for outside of both.
ProjectionGeometry::PixelRays pixel_rays_of(const ProjectionGeometry& geometry);

}  // namespace kiroku::sim
