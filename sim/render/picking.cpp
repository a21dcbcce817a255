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

Eigen::Vector2d on_picture(const Camera& camera, const Vector3& patient_m) {
  const Vector3 seen_m = in_depth_m(camera, patient_m);
  const Eigen::Vector2d at =
      (seen_m.head<2>() / seen_m.z() - camera.centre).cwiseQuotient(camera.half_extent);
  return {(1 + at.x()) / 2, (1 - at.y()) / 2};
}

std::optional<MetFace> first_met(std::span<const Face> surface, std::span<const Vector3> places_m,
                                 const Eigen::Vector2d& slope) {
  std::optional<MetFace> first;
  double nearest = 0;  // as one divided by the depth, which is linear over a projected face
  for (std::size_t face = 0; face < surface.size(); ++face) {
    const auto& nodes = surface[face].nodes;
    const Vector3 &a = places_m[nodes[0]], &b = places_m[nodes[1]], &c = places_m[nodes[2]];
    const Eigen::Vector2d at_a = a.head<2>() / a.z(), ab = b.head<2>() / b.z() - at_a,
                          ac = c.head<2>() / c.z() - at_a, to = slope - at_a;
    const double area = ab.x() * ac.y() - ab.y() * ac.x();
    if (area == 0) continue;
    const double of_b = (to.x() * ac.y() - to.y() * ac.x()) / area,
                 of_c = (ab.x() * to.y() - ab.y() * to.x()) / area;
    if (of_b < 0 || of_c < 0 || of_b + of_c > 1) continue;
    const Vector3 parts((1 - of_b - of_c) / a.z(), of_b / b.z(), of_c / c.z());
    if (parts.sum() <= nearest) continue;
    nearest = parts.sum();
    // Weights of the picture become those of the face in space.
    first = MetFace{face, parts / nearest, 1 / nearest};
  }
  return first;
}

std::optional<double> depth_along(std::span<const Face> surface, std::span<const Vector3> places_m,
                                  const Eigen::Vector2d& slope) {
  const auto met = first_met(surface, places_m, slope);
  if (!met) return {};
  return met->depth_m;
}

}  // namespace kiroku::sim
