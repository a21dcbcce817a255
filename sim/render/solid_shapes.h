// Tools and points as triangles. Pure, thread-safe.
#pragma once

#include <vector>

#include "sim/contact/tool_shape.h"
#include "sim/render/picture.h"

namespace kiroku::sim {

/// Something opaque in the picture.
struct Solid {
  ToolShape shape;
  Pose pose;
  Rgb colour{200, 200, 205};
};

struct SolidVertex {
  Vector3 position_m, normal;
};
/// Three vertices a triangle, anticlockwise from outside, in the mesh's frame. Round shapes have 24 sides.
std::vector<SolidVertex> triangles_of(const Solid& solid);

}  // namespace kiroku::sim
