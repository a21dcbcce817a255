#include "sim/cutting/closest_point.h"

#include <algorithm>

#include <Eigen/Geometry>

namespace kiroku::sim {
namespace {

/// How far along from a to b the nearest point is, 0 to 1.
double along_segment(const Vector3& point, const Vector3& a, const Vector3& b) {
  const double squared_length = (b - a).squaredNorm();
  return squared_length > 0 ? std::clamp((point - a).dot(b - a) / squared_length, 0.0, 1.0) : 0.0;
}

}  // namespace

Vector3 closest_on_segment(const Vector3& point, const Vector3& a, const Vector3& b) {
  return a + along_segment(point, a, b) * (b - a);
}

Vector3 closest_weights(const Vector3& point, const std::array<Vector3, 3>& triangle) {
  const Vector3 normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]);
  const double squared = normal.squaredNorm();
  if (squared > 0) {
    Vector3 weights;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3 &next = triangle[(i + 1) % 3], &last = triangle[(i + 2) % 3];
      weights[static_cast<Eigen::Index>(i)] = (last - next).cross(point - next).dot(normal) / squared;
    }
    if (weights.minCoeff() >= 0) return weights / weights.sum();
  }
  // Outside, the nearest point is on a side.
  Vector3 best = Vector3::Unit(0);
  double least = -1;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t next = (i + 1) % 3;
    const double along = along_segment(point, triangle[i], triangle[next]);
    const double distance = (triangle[i] + along * (triangle[next] - triangle[i]) - point).squaredNorm();
    if (least >= 0 && distance >= least) continue;
    least = distance;
    best.setZero();
    best[static_cast<Eigen::Index>(i)] = 1 - along;
    best[static_cast<Eigen::Index>(next)] = along;
  }
  return best;
}

Vector3 closest_on_triangle(const Vector3& point, const std::array<Vector3, 3>& triangle) {
  const Vector3 weights = closest_weights(point, triangle);
  return weights[0] * triangle[0] + weights[1] * triangle[1] + weights[2] * triangle[2];
}

}  // namespace kiroku::sim
