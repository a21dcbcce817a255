// Finding how a patient lay when a radiograph was made: 2D/3D registration of a CT. Pure, thread-safe.
#pragma once

#include <functional>
#include <span>

#include "sim/drr/ct_projector.h"

namespace kiroku::sim {

/// Gradient correlation: the mean of the zero-mean normalised cross-correlations of the differences along
/// rows and down columns (Penney et al., IEEE Transactions on Medical Imaging 17(4), 1998); 1 for pictures
/// that differ by a linear scale, 0 where one of them is flat. Edges count, so that a detector's own response
/// matters little. kiroku::Error for pictures of different sizes or of fewer than 2 x 2 pixels.
double gradient_correlation(const ProjectionImage& a, const ProjectionImage& b);

/// Means of `factor` by `factor` pixels, as ProjectionGeometry::binned() sees them.
ProjectionImage binned(const ProjectionImage& image, std::size_t factor);

struct Registration {
  Eigen::Isometry3d motion =
      Eigen::Isometry3d::Identity();                   // from where the CT has the patient to where they lay
  Vector3 translation_m = Vector3::Zero();             // of the centre
  Vector3 rotation_rad = Vector3::Zero();              // about the centre: axis times angle
  double similarity_before = 0, similarity_after = 0;  // in the radiograph's own pixels
  std::size_t projections = 0;                         // that were computed
};

/// Moves the patient as a rigid body, about `centre_m`, so that the projection becomes as similar as can be
/// found (Hooke and Jeeves' pattern search, J. ACM 8(2), 1961), in pixels that become smaller. Finds what is
/// within some 20 mm and 10 degrees; how far away the patient is shows least. `project` is the CT, perhaps
/// deformed; the radiograph has the geometry's pixels, else kiroku::Error. `progress` is told the parts done
/// of all.
Registration register_rigidly(const ProjectionImage& radiograph, const ProjectionGeometry& geometry,
                              const Vector3& centre_m,
                              const std::function<ProjectionImage(const ProjectionGeometry&)>& project,
                              const std::function<void(std::size_t, std::size_t)>& progress = {});

/// One of several radiographs of a patient who lay still, each with a geometry of its own.
struct RegistrationView {
  ProjectionImage radiograph;
  ProjectionGeometry geometry;
};
/// The same from several sides at once: the mean similarity of all views becomes as great as can be found.
/// One view at least.
Registration register_rigidly(std::span<const RegistrationView> views, const Vector3& centre_m,
                              const std::function<ProjectionImage(const ProjectionGeometry&)>& project,
                              const std::function<void(std::size_t, std::size_t)>& progress = {});

/// translate(centre + translation) rotate translate(-centre); `rotation_rad` is axis times angle.
Eigen::Isometry3d rigid_motion(const Vector3& translation_m, const Vector3& rotation_rad,
                               const Vector3& centre_m);

}  // namespace kiroku::sim
