// Vectors as shaders take them.
#pragma once

#include <array>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

using Float4 = std::array<float, 4>;

/// In single precision, with a fourth component.
inline Float4 single(const Vector3& v, double fourth = 0) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z()),
          static_cast<float>(fourth)};
}

}  // namespace kiroku::sim
