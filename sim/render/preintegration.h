// What a stretch of a ray shows whose HU run straight from one number to another: a table of two dimensions,
// so that coarse steps show no slices. Plain data; the function is pure and thread-safe.
//
// Source: Engel, Kraus and Ertl, "High-Quality Pre-Integrated Volume Rendering Using Hardware-Accelerated
// Pixel Shading", Graphics Hardware 2001, pages 9 to 16, equations 5 to 7. A segment takes from the light
// that comes from behind by its mean extinction, which is exact for any length. Its colour is what it gives
// towards the eye over what it takes; that tissue in front hides tissue behind within it is as of one length,
// the third dimension of the paper's table.
#pragma once

#include <cstdint>
#include <vector>

#include "sim/render/transfer_function.h"

namespace kiroku::sim {

struct Preintegration {
  /// HU are told apart by so many nodes: close where colour or opacity change, wide where they do not.
  static constexpr std::size_t kNodes = 256;
  static constexpr float kExtinctionScale = 64;

  double length_mm = 0;
  /// (kHuEntries): the node that stands for each HU.
  std::vector<std::uint8_t> node_of;
  /// (kNodes): the entry whose HU a node is.
  std::vector<std::uint16_t> entry_of;
  /// (kNodes x kNodes x 4), the node at the segment's end fastest: red, green, blue (0 to 1) and
  /// kExtinctionScale times the extinction per mm, as IEEE 754's numbers of 16 bits. None is subnormal:
  /// extinction below 1e-6 is none.
  std::vector<std::uint16_t> segments;
};

/// `length_mm` more than 0; `linear`: colours are linear in light (tip_lighting.h).
Preintegration preintegrate(const TransferFunction& transfer, double length_mm, bool linear = false);

}  // namespace kiroku::sim
