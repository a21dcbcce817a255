// The nodes of a held body's surface that a tool can touch.
#pragma once

#include <cstdint>
#include <vector>

#include "sim/fem/elastic_body.h"

namespace kiroku::sim {

/// Immutable once made. Nodes that nothing can move (no free_components()) are not in it: tools pass through
/// them.
struct TouchableSurface {
  explicit TouchableSurface(const ElasticBody& body);

  std::vector<std::uint32_t> nodes;  // of the mesh, in groups that lie beside each other, as PointTree asks
  std::vector<double> area_m2;       // (|nodes|), of the undeformed surface: a third of each face around it
  std::vector<std::uint8_t> free;    // (|nodes|), 1 where no component is prescribed
  std::vector<std::uint32_t> place_of;  // (|V|), in nodes; kNowhere for those that are not in it
  double size_m = 0;                    // of the body: its longest side

  static constexpr std::uint32_t kNowhere = 0xFFFFFFFF;
};

}  // namespace kiroku::sim
