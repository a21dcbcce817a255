#include "sim/contact/tool_shape.h"

#include <algorithm>
#include <cmath>

#include "base/number_text.h"

namespace kiroku::sim {
namespace {

std::string length_problem(const char* name, double length_m) {
  if (std::isfinite(length_m) && length_m > 0) return {};
  return std::string("its ") + name + " is " + number_text(length_m) + " m: it must be greater than zero";
}

/// To what is within `radius_m` of a point or line whose nearest point is `-from_axis_m` away.
SurfaceDistance round_distance(const Vector3& from_axis_m, double radius_m) {
  const double length_m = from_axis_m.norm();
  if (length_m == 0) return {-radius_m, Vector3::UnitX()};
  return {length_m - radius_m, from_axis_m / length_m};
}

SurfaceDistance box_distance(const Box& box, const Vector3& point_m) {
  const Vector3 beyond_m = point_m.cwiseAbs() - box.half_extent_m;  // of each face
  const auto sign = [](double number) { return number < 0 ? -1.0 : 1.0; };
  const Vector3 outside_m = beyond_m.cwiseMax(0);
  if (const double distance_m = outside_m.norm(); distance_m > 0) {
    SurfaceDistance found{distance_m, outside_m / distance_m};
    for (Eigen::Index i = 0; i < 3; ++i) found.normal[i] *= sign(point_m[i]);
    return found;
  }
  Eigen::Index nearest = 0;
  const double distance_m = beyond_m.maxCoeff(&nearest);
  return {distance_m, sign(point_m[nearest]) * Vector3::Unit(nearest)};
}

struct Distance {
  const Vector3& point_m;
  SurfaceDistance operator()(const Sphere& sphere) const { return round_distance(point_m, sphere.radius_m); }
  SurfaceDistance operator()(const Capsule& capsule) const {
    const double along_m = std::clamp(point_m.z(), -capsule.half_length_m, capsule.half_length_m);
    return round_distance(point_m - along_m * Vector3::UnitZ(), capsule.radius_m);
  }
  SurfaceDistance operator()(const Box& box) const { return box_distance(box, point_m); }
};

struct Problem {
  std::string operator()(const Sphere& sphere) const { return length_problem("radius", sphere.radius_m); }
  std::string operator()(const Capsule& capsule) const {
    if (!std::isfinite(capsule.half_length_m) || capsule.half_length_m < 0)
      return "its half length is " + number_text(capsule.half_length_m) + " m: it must not be negative";
    return length_problem("radius", capsule.radius_m);
  }
  std::string operator()(const Box& box) const {
    for (const double half_m : box.half_extent_m) {
      if (std::string problem = length_problem("half extent", half_m); !problem.empty()) return problem;
    }
    return {};
  }
};

struct BoundingRadius {
  double operator()(const Sphere& sphere) const { return sphere.radius_m; }
  double operator()(const Capsule& capsule) const { return capsule.radius_m + capsule.half_length_m; }
  double operator()(const Box& box) const { return box.half_extent_m.norm(); }
};

}  // namespace

std::string problem_of(const ToolShape& shape) { return std::visit(Problem{}, shape); }

SurfaceDistance distance_to(const ToolShape& shape, const Vector3& point_m) {
  return std::visit(Distance{point_m}, shape);
}

double bounding_radius_m(const ToolShape& shape) { return std::visit(BoundingRadius{}, shape); }

}  // namespace kiroku::sim
