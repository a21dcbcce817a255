// How an organ may be deformed, as few numbers: the displacement of its surface as the response of its finite
// elements to unknown forces on patches of the surface. Immutable once made; functions are thread-safe.
//
// Source: responses to forces on patches are columns of the compliance K^-1 (compliance.h). Linear elements
// swell where they turn; so each node's response is turned along with its tissue (Choi and Ko, "Modal
// Warping: Real-Time Simulation of Large Rotational Deformation and Manipulation", IEEE TVCG 2005, equation
// 18): with the response v and the rotation w, half its curl, both linear in the forces,
//   u = integral of exp(s w) over s from 0 to 1, times v
//     = v + (1 - cos |w|) / |w|^2 w x v + (|w| - sin |w|) / |w|^3 w x (w x v).
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "sim/align/organ_surface.h"
#include "sim/fem/elastic_body.h"

namespace kiroku::sim {

struct DeformableOrganOptions {
  /// Forces act on so many patches, spread evenly over the part of the surface that is free; fewer where it
  /// has fewer nodes.
  std::size_t patches = 60;
  /// Root of the mean squared displacement of the surface's nodes that is expected beforehand, m.
  double expected_m = 0.01;
};

/// A place on the surface that stays with the tissue.
struct SurfacePlace {
  std::uint32_t face = 0;
  Vector3 weights = Vector3::Zero();  // of the face's nodes; sum 1
};
/// The nearest one; time grows with the surface.
SurfacePlace nearest_place(const OrganSurface& surface, const Vector3& at_m);
Vector3 place_m(const OrganSurface& surface, const SurfacePlace& place);

/// The organ under certain forces.
struct OrganShape {
  std::vector<Vector3> displacement_m;        // (|S|), of the surface's nodes
  OrganSurface surface;                       // displaced; its middle and radius are those at rest
  std::vector<Vector3> response_m, rotation;  // (|S|): v, and w in radians
};

class DeformableOrgan {
 public:
  /// The body's fixed nodes stay where they are. As patches all have the same force expected, and the size of
  /// all together follows from `expected_m`, Young's modulus falls out where it is the same everywhere.
  /// kiroku::UsageError where the surface has no free node, or the options are not above zero; kiroku::Error
  /// as ElasticBody::solve().
  explicit DeformableOrgan(const ElasticBody& body, const DeformableOrganOptions& options = {});

  [[nodiscard]] const OrganSurface& surface() const { return surface_; }  // at rest, |S| nodes
  /// How many coefficients there are: three forces a patch. Before anything is seen, they are independent,
  /// of mean 0 and variance 1.
  [[nodiscard]] Eigen::Index unknowns() const { return response_m_.cols(); }

  [[nodiscard]] OrganShape shape(const Eigen::VectorXd& coefficients) const;
  /// Of a surface node's displacement with the coefficients; (3 x unknowns), m.
  [[nodiscard]] Eigen::Matrix3Xd derivative(const OrganShape& shape, std::uint32_t node) const;

 private:
  OrganSurface surface_;
  Eigen::MatrixXd response_m_;  // (3|S| x unknowns)
  Eigen::MatrixXd rotation_;    // likewise, radians
};

}  // namespace kiroku::sim
