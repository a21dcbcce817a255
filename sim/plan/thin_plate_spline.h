// A smooth mapping of space that brings landmarks of one organ onto those of another.
//
//   T(x) = A x + t + sum_i w_i |x - p_i|,  T(p_i) = q_i
//
// Of all mappings through the landmarks the one that bends least. Source: thin-plate splines (Duchon,
// "Splines minimizing rotation-invariant semi-norms in Sobolev spaces", 1977; Bookstein, IEEE PAMI 11, 1989),
// whose kernel in three dimensions is the distance. Lengths in metres. Immutable, thread-safe.
#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

class ThinPlateSpline {
 public:
  /// As many of both, at least four. kiroku::Error in a sentence where no such mapping is told by them:
  /// fewer, two at one place, all (nearly) in one plane, or a mirror image.
  ThinPlateSpline(std::span<const Vector3> from_m, std::span<const Vector3> to_m);

  [[nodiscard]] Vector3 at(const Vector3& place_m) const;
  [[nodiscard]] Eigen::Matrix3d gradient(const Vector3& place_m) const;
  /// How a thing at that place is turned: the rotation nearest to the gradient. kiroku::Error where the
  /// mapping folds there.
  [[nodiscard]] Eigen::Matrix3d turn(const Vector3& place_m) const;

  /// Landmarks lie in a plane where their spread across it is not more than this part of their largest.
  static constexpr double kFlattest = 0.05;

 private:
  std::vector<Vector3> from_m_;
  Eigen::Matrix<double, Eigen::Dynamic, 3> weights_;  // (n + 4) rows: w_i, t, A by columns
};

/// Whether one organ's landmarks can tell a mapping at all. kiroku::Error in a sentence, with `whose` ("the
/// template"), where they are fewer than four, two lie at one place, or all lie (nearly) in one plane.
void check_landmarks(std::span<const Vector3> places_m, const std::string& whose);

/// The affine mapping that fits best in the mean square; (n) distances that it leaves, m. What is known of
/// the landmarks is as for ThinPlateSpline.
std::vector<double> affine_residuals_m(std::span<const Vector3> from_m, std::span<const Vector3> to_m);

}  // namespace kiroku::sim
