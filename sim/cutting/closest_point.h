// Nearest points of triangles, segments and tetrahedra. Pure functions, thread-safe.
#pragma once

#include <array>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// Of the segment from a to b; a where they are one point.
Vector3 closest_on_segment(const Vector3& point, const Vector3& a, const Vector3& b);

/// Of the triangle, as weights of its corners that sum to one (Ericson, "Real-Time Collision Detection",
/// 5.1.5). Corners on one line are taken as their longest side.
Vector3 closest_weights(const Vector3& point, const std::array<Vector3, 3>& triangle);
Vector3 closest_on_triangle(const Vector3& point, const std::array<Vector3, 3>& triangle);

}  // namespace kiroku::sim
