#include "sim/render/solid_shapes.h"

#include <array>
#include <cmath>
#include <numbers>

namespace kiroku::sim {
namespace {

constexpr int kSides = 24, kRings = 12;

/// A sphere that is pulled apart at its equator by `half_length_m` along z each way.
std::vector<SolidVertex> capsule(double radius_m, double half_length_m) {
  std::vector<SolidVertex> vertices;
  const auto vertex = [&](int ring, int side) {
    const double polar = std::numbers::pi * ring / kRings, around = 2 * std::numbers::pi * side / kSides;
    const Vector3 normal(std::sin(polar) * std::cos(around), std::sin(polar) * std::sin(around),
                         std::cos(polar));
    // The ring of the equator belongs to both halves; its band is as long as the capsule.
    const double shift_m = 2 * ring <= kRings ? half_length_m : -half_length_m;
    return SolidVertex{radius_m * normal + Vector3(0, 0, shift_m), normal};
  };
  const auto band = [&](const auto& upper, const auto& lower) {
    for (int side = 0; side < kSides; ++side) {
      const SolidVertex a = upper(side), b = lower(side), c = lower(side + 1), d = upper(side + 1);
      vertices.insert(vertices.end(), {a, b, c, a, c, d});
    }
  };
  for (int ring = 0; ring < kRings; ++ring)
    band([&](int side) { return vertex(ring, side); }, [&](int side) { return vertex(ring + 1, side); });
  return vertices;
}

std::vector<SolidVertex> box(const Vector3& half_m) {
  std::vector<SolidVertex> vertices;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      Vector3 normal = Vector3::Zero();
      normal[axis] = side;
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      const auto corner = [&](double along_u, double along_v) {
        Vector3 place = normal;
        place[u] = along_u * side;
        place[v] = along_v;
        return SolidVertex{place.cwiseProduct(half_m), normal};
      };
      const std::array<SolidVertex, 4> corners{corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)};
      for (const std::size_t at : {0U, 1U, 2U, 0U, 2U, 3U}) vertices.push_back(corners[at]);
    }
  }
  return vertices;
}

std::vector<SolidVertex> triangles_in_tool(const ToolShape& shape) {
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return capsule(sphere->radius_m, 0);
  if (const auto* rod = std::get_if<Capsule>(&shape)) return capsule(rod->radius_m, rod->half_length_m);
  return box(std::get<Box>(shape).half_extent_m);
}

}  // namespace

std::vector<SolidVertex> triangles_of(const Solid& solid) {
  std::vector<SolidVertex> vertices = triangles_in_tool(solid.shape);
  for (SolidVertex& vertex : vertices) {
    vertex.position_m = solid.pose.from_tool(vertex.position_m);
    vertex.normal = solid.pose.orientation * vertex.normal;
  }
  return vertices;
}

}  // namespace kiroku::sim
