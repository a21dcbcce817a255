#include "sim/cutting/sweep_surface.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "base/error.h"
#include "sim/cutting/closest_point.h"

namespace kiroku::sim {
namespace {

/// Below this ratio of its height to its longest side a triangle has no plane to speak of.
constexpr double kFlat = 1e-9;

/// The sign of six volumes of a, b, c, d; 0 where they are in one plane but for rounding.
int orientation(const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& d) {
  const Vector3 ab = b - a, ac = c - a, ad = d - a;
  const double volume = ab.dot(ac.cross(ad));
  const double limit = SweepSurface::kTouch * ab.norm() * ac.norm() * ad.norm();
  return volume > limit ? 1 : volume < -limit ? -1 : 0;
}

}  // namespace

SweepSurface::SweepSurface(const BladePose& from, const BladePose& to) : from_(from), to_(to) {
  for (const Vector3& end : {from.tip, from.heel, to.tip, to.heel}) {
    // Products of three lengths must stay finite.
    if (!end.allFinite() || end.cwiseAbs().maxCoeff() > 1e30)
      throw UsageError("a blade's pose is not finite");
  }
  extent_.least = from.tip.cwiseMin(from.heel).cwiseMin(to.tip).cwiseMin(to.heel);
  extent_.greatest = from.tip.cwiseMax(from.heel).cwiseMax(to.tip).cwiseMax(to.heel);
  if (from.tip == from.heel || to.tip == to.heel)
    throw UsageError("the blade's edge has no length: its tip and its heel are one point");
  triangles_[0] = {{from.tip, from.heel, to.heel}, {true, false, true}, Vector3::Zero(), true};
  triangles_[1] = {{from.tip, to.heel, to.tip}, {true, false, false}, Vector3::Zero(), true};
  for (Triangle& triangle : triangles_) {
    const auto& [a, b, c] = triangle.corners;
    const double longest_m = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
    triangle.normal = (b - a).cross(c - a);
    triangle.flat = !(triangle.normal.norm() > kFlat * longest_m * longest_m);
    if (!triangle.flat) triangle.normal.normalize();
  }
  if (triangles_[0].flat && triangles_[1].flat)
    throw UsageError("the blade's edge does not move, or only along itself: it sweeps no surface");
  // Without the second triangle the diagonal is the edge the sweep ends with.
  if (triangles_[1].flat) triangles_[0].side_belongs[2] = false;
}

double SweepSurface::area_m2() const {
  double area_m2 = 0;
  for (const Triangle& triangle : triangles_) {
    const auto& [a, b, c] = triangle.corners;
    area_m2 += (b - a).cross(c - a).norm() / 2;
  }
  return area_m2;
}

int SweepSurface::crossing(const Vector3& a, const Vector3& b) const {
  for (const Triangle& triangle : triangles_) {
    if (triangle.flat) continue;
    const Vector3& origin = triangle.corners[0];
    const double reach_m = (triangle.corners[1] - origin).norm() + (triangle.corners[2] - origin).norm();
    const auto before = [&](const Vector3& point) {
      const Vector3 arm = point - origin;
      return triangle.normal.dot(arm) >= -kTouch * (arm.norm() + reach_m);
    };
    const bool a_before = before(a);
    if (a_before == before(b)) continue;
    // Seen from the side the normal points to, an edge that goes through has all three sides on its left.
    const Vector3 &above = a_before ? a : b, &below = a_before ? b : a;
    bool inside = true;
    for (std::size_t i = 0; i < 3 && inside; ++i) {
      const int side = -orientation(above, below, triangle.corners[i], triangle.corners[(i + 1) % 3]);
      inside = side > 0 || (side == 0 && triangle.side_belongs[i]);
    }
    if (inside) return a_before ? 1 : -1;
  }
  return 0;
}

SweepSurface::Nearest SweepSurface::nearest(const Vector3& point) const {
  Nearest nearest{Vector3::Zero(), Vector3::Zero()};
  double least = -1;
  for (const Triangle& triangle : triangles_) {
    if (triangle.flat) continue;
    const Vector3 candidate = closest_on_triangle(point, triangle.corners);
    const double distance = (candidate - point).norm();
    const double same = kTouch * (distance + (triangle.corners[1] - triangle.corners[0]).norm());
    if (least >= 0 && std::abs(distance - least) <= same) {
      nearest.normal = (nearest.normal + triangle.normal).normalized();  // on the diagonal
    } else if (least < 0 || distance < least) {
      least = distance;
      nearest = {candidate, triangle.normal};
    }
  }
  return nearest;
}

}  // namespace kiroku::sim
