#include "sim/contact/point_tree.h"

#include <algorithm>

namespace kiroku::sim {

PointTree::PointTree(std::size_t points) : points_(points) {
  std::size_t boxes = (points + kLeaf - 1) / kLeaf;
  levels_.emplace_back(boxes);
  while (boxes > 1) {
    boxes = (boxes + 1) / 2;
    levels_.emplace_back(boxes);
  }
}

void PointTree::refit(const Eigen::VectorXd& positions_m) {
  for (std::size_t leaf = 0; leaf < levels_[0].size(); ++leaf) {
    const double* position_m = positions_m.data() + 3 * kLeaf * leaf;
    const double* const end_m = positions_m.data() + 3 * std::min(kLeaf * (leaf + 1), points_);
    // In scalars: whole vectors of three would go through memory each time.
    double low[3] = {position_m[0], position_m[1], position_m[2]}, high[3] = {low[0], low[1], low[2]};
    for (position_m += 3; position_m != end_m; position_m += 3) {
      for (std::size_t i = 0; i < 3; ++i) {
        low[i] = std::min(low[i], position_m[i]);
        high[i] = std::max(high[i], position_m[i]);
      }
    }
    levels_[0][leaf] = {{low[0], low[1], low[2]}, {high[0], high[1], high[2]}};
  }
  for (std::size_t level = 1; level < levels_.size(); ++level) {
    const std::vector<Box>& below = levels_[level - 1];
    for (std::size_t at = 0; at < levels_[level].size(); ++at) {
      const Box& one = below[2 * at];
      const Box& other = below[std::min(2 * at + 1, below.size() - 1)];
      levels_[level][at] = {one.least.cwiseMin(other.least), one.greatest.cwiseMax(other.greatest)};
    }
  }
}

}  // namespace kiroku::sim
