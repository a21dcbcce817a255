#include "sim/render/picking.h"

#include <algorithm>

namespace kiroku::sim {

Vector3 in_depth_m(const Camera& camera, const Vector3& patient_m) {
  const Vector3 view_m = camera.view_m(patient_m);
  return {view_m.x(), view_m.y(), -view_m.z()};
}

Vector3 from_depth_m(const Camera& camera, const Vector3& place_m) {
  return camera.eye_m + camera.to_view.transpose() * Vector3(place_m.x(), place_m.y(), -place_m.z());
}

Eigen::Vector2d slope_of(const Camera& camera, double x, double y) {
  return camera.centre +
         Eigen::Vector2d((2 * x - 1) * camera.half_extent.x(), (1 - 2 * y) * camera.half_extent.y());
}

std::optional<double> depth_along(std::span<const Face> surface, std::span<const Vector3> places_m,
                                  const Eigen::Vector2d& slope) {
  double nearest = 0;  // as one divided by the depth, which is linear over a projected face
  for (const Face& face : surface) {
    const Vector3 &a = places_m[face.nodes[0]], &b = places_m[face.nodes[1]], &c = places_m[face.nodes[2]];
    const Eigen::Vector2d at_a = a.head<2>() / a.z(), ab = b.head<2>() / b.z() - at_a,
                          ac = c.head<2>() / c.z() - at_a, to = slope - at_a;
    const double area = ab.x() * ac.y() - ab.y() * ac.x();
    if (area == 0) continue;
    const double of_b = (to.x() * ac.y() - to.y() * ac.x()) / area,
                 of_c = (ab.x() * to.y() - ab.y() * to.x()) / area;
    if (of_b < 0 || of_c < 0 || of_b + of_c > 1) continue;
    nearest = std::max(nearest, (1 - of_b - of_c) / a.z() + of_b / b.z() + of_c / c.z());
  }
  if (nearest <= 0) return {};
  return 1 / nearest;
}

}  // namespace kiroku::sim
