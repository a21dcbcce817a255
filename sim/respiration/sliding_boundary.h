// A lung brought to the surface of a second CT, sliding along it: elastic energy and surface distances
// together are made least. Pure functions, thread-safe.
//
// Source: a Gauss-Newton iteration on  U(u - A u) + sum k_i r_i(u)^2 / 2.
//  - U is the energy of linear elasticity, of what is left after the stretch A of the lung as a whole that
//    leaves least of it: a lung that fills with air grows evenly without any force from its wall, so only
//    what is uneven counts.
//  - r are distances along the normal of the second surface alone, both ways: from nodes of the lung's
//    surface to the second one, and from points all over that to the nearest faces of the lung that look the
//    same way. Across the normal nothing is asked, so that the lung slides (Al-Mayah et al., Physics in
//    Medicine and Biology 56, 2011). Distances beyond a few millimetres count as absolute values (Huber).
//  - k, the stiffness of that coupling, is annealed: soft at first, when little is known of what lies where,
//    stiff at the end.
// Springs may draw an element through itself. Such elements are then stiffened, again and again, until none
// is left: an element that is stiff enough follows the even stretch, which turns nothing inside out.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "sim/fem/elastic_body.h"
#include "sim/respiration/lung_surface.h"
#include "sim/respiration/mesh_point.h"
#include "sim/volume/distance_field.h"

namespace kiroku::sim {

struct SlidingOptions {
  /// Of all tissue while it is fitted, -1 < nu < 0.5; the materials' own where absent.
  std::optional<double> poisson_ratio;
  /// Young's modulus over the coupling's stiffness per area, at the end, m: the smaller, the nearer the lung
  /// comes to the second surface. Found by cross-validation on that surface
  /// (docs/explanation/respiration.md).
  double yield_m = 0.0015;
  /// Places of the second CT whose surface does not count.
  std::function<bool(const Vector3&)> leave_out;
  /// Where these are, `start_m` has the inside right: the energy counts from there instead of from an even
  /// stretch, and each of these points is held where `start_m` takes it.
  std::vector<LocatedPoint> held;
};

/// Points on the second surface, about 4 mm from each other; patient coordinates of the second CT.
struct SurfacePoints {
  std::vector<Vector3> places_m, normals;  // normals of length 1, outwards
};
SurfacePoints points_on(const DistanceField& field);

/// (3 |V|), m, from `start_m`, in the first CT's axes: a node at x goes to placement (x + displacement).
/// kiroku::Error where the second surface has no points, and what Factorisation throws. Elements that could
/// not be kept from turning inside out are left so: count them. Same input, same bits.
Eigen::VectorXd slide_to(const TetMesh& mesh, const Materials& materials, const LungSurface& surface,
                         const DistanceField& second, const SurfacePoints& points,
                         const Eigen::Isometry3d& placement, const Eigen::VectorXd& start_m,
                         const SlidingOptions& options = {});

/// How far each of the points that `counts` names is from the lung's surface as it lies then, m: along the
/// point's normal to the nearest face that looks the same way, else to the nearest node.
std::vector<double> distances_to_lung_m(const TetMesh& mesh, const LungSurface& surface,
                                        const SurfacePoints& points, const Eigen::Isometry3d& placement,
                                        const Eigen::VectorXd& displacement_m,
                                        const std::function<bool(const Vector3&)>& counts);

}  // namespace kiroku::sim
