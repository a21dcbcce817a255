// The surface of an organ for whoever draws its outline over a picture: no finer than it takes. A pure
// function, thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "sim/align/organ_surface.h"

namespace kiroku::sim {

struct DrawnSurface {
  std::vector<Vector3> nodes;                       // (|V|), m
  std::vector<std::array<std::uint32_t, 3>> faces;  // anticlockwise from outside
  double moved_m = 0;                  // how far a node of the organ is off its own place at most
  std::vector<std::uint32_t> of_node;  // (|S|), the node that stands for each of the organ's
};

/// As it is where it has at most that many nodes (at least 8). Else the nodes within each cell of a grid
/// become one in their middle (Rossignac and Borrel, "Multi-resolution 3D Approximations for Rendering
/// Complex Scenes", 1993): crude, but the outline moves by `moved_m` at most.
DrawnSurface drawn_surface(const OrganSurface& surface, std::size_t most_nodes);

}  // namespace kiroku::sim
