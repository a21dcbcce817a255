#include "sim/render/colour_map.h"

#include <algorithm>
#include <cmath>

namespace kiroku::sim {

Rgb viridis(double share) {
  // Every 32nd of the published 256 colours, straight lines between.
  constexpr std::array<Rgb, 9> kColours{{{68, 1, 84},
                                         {71, 44, 122},
                                         {59, 81, 139},
                                         {44, 113, 142},
                                         {33, 144, 141},
                                         {39, 173, 129},
                                         {92, 200, 99},
                                         {170, 220, 50},
                                         {253, 231, 37}}};
  const double at = std::clamp(share, 0.0, 1.0) * double(kColours.size() - 1);
  const std::size_t below = std::min(static_cast<std::size_t>(at), kColours.size() - 2);
  const double part = at - double(below);
  Rgb colour{};
  for (std::size_t c = 0; c < colour.size(); ++c) {
    colour[c] = static_cast<std::uint8_t>(
        std::lround(kColours[below][c] * (1 - part) + kColours[below + 1][c] * part));
  }
  return colour;
}

}  // namespace kiroku::sim
