#include "sim/align/drawn_surface.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

namespace kiroku::sim {
namespace {

using Cell = std::array<std::int64_t, 3>;

struct Clusters {
  std::vector<std::uint32_t> of_node;
  std::size_t count = 0;
};

Clusters clusters_of(const OrganSurface& surface, double side_m) {
  std::map<Cell, std::uint32_t> numbers;
  Clusters clusters;
  clusters.of_node.reserve(surface.nodes.size());
  for (const Vector3& node : surface.nodes) {
    const Vector3 at = (node - surface.middle_m) / side_m;
    const Cell cell{std::llround(at.x()), std::llround(at.y()), std::llround(at.z())};
    const auto [entry, is_new] = numbers.try_emplace(cell, static_cast<std::uint32_t>(numbers.size()));
    clusters.of_node.push_back(entry->second);
  }
  clusters.count = numbers.size();
  return clusters;
}

DrawnSurface joined(const OrganSurface& surface, const Clusters& clusters) {
  DrawnSurface drawn;
  drawn.nodes.assign(clusters.count, Vector3::Zero());
  std::vector<double> members(clusters.count, 0);
  for (std::size_t i = 0; i < surface.nodes.size(); ++i) {
    drawn.nodes[clusters.of_node[i]] += surface.nodes[i];
    members[clusters.of_node[i]] += 1;
  }
  for (std::size_t i = 0; i < drawn.nodes.size(); ++i) drawn.nodes[i] /= members[i];
  for (std::size_t i = 0; i < surface.nodes.size(); ++i) {
    drawn.moved_m = std::max(drawn.moved_m, (drawn.nodes[clusters.of_node[i]] - surface.nodes[i]).norm());
  }
  for (const auto& face : surface.faces) {
    std::array<std::uint32_t, 3> nodes{};
    for (std::size_t i = 0; i < 3; ++i) nodes[i] = clusters.of_node[face[i]];
    // What lies within a cell, or along a border of two, has no area left.
    if (nodes[0] != nodes[1] && nodes[1] != nodes[2] && nodes[2] != nodes[0]) drawn.faces.push_back(nodes);
  }
  drawn.of_node = clusters.of_node;
  return drawn;
}

}  // namespace

DrawnSurface drawn_surface(const OrganSurface& surface, std::size_t most_nodes) {
  constexpr std::size_t kLeast = 8;
  const std::size_t most = std::max(most_nodes, kLeast);
  if (surface.nodes.size() <= most) {
    std::vector<std::uint32_t> same(surface.nodes.size());
    std::iota(same.begin(), same.end(), 0U);
    return {surface.nodes, surface.faces, 0, std::move(same)};
  }
  // Begins where a ball of that size would have twice as many. Four times its reach is one cell for all.
  constexpr double kGrowth = 1.2, kTwiceAsMany = 2.5;
  double side_m = kTwiceAsMany * surface.reach_m / std::sqrt(double(most));
  Clusters clusters = clusters_of(surface, side_m);
  while (clusters.count > most) {
    side_m *= kGrowth;
    clusters = clusters_of(surface, side_m);
  }
  return joined(surface, clusters);
}

}  // namespace kiroku::sim
