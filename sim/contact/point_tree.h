// Which points of a moving surface are near a place: a hierarchy of boxes around points that lie beside each
// other, refitted as they move. Not thread-safe.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "sim/mesh/tet_mesh.h"

namespace kiroku::sim {

/// The points must be in an order in which every kLeaf of them, from the first, lie beside each other, as
/// neighbouring_groups() puts them.
class PointTree {
 public:
  explicit PointTree(std::size_t points);
  static constexpr std::size_t kLeaf = 8;

  /// `positions_m` (3 |points|). Linear in their number; allocates nothing.
  void refit(const Eigen::VectorXd& positions_m);

  /// Calls visit(point) for every point within `radius_m` of the centre, in ascending order, and for some
  /// beside these.
  template <typename Visit>
  void visit_near(const Vector3& centre_m, double radius_m, Visit visit) const {
    if (points_ > 0) descend(levels_.size() - 1, 0, centre_m, radius_m * radius_m, visit);
  }

 private:
  struct Box {
    Vector3 least, greatest;
  };

  template <typename Visit>
  void descend(std::size_t level, std::size_t at, const Vector3& centre_m, double radius_squared_m2,
               Visit& visit) const {
    const Box& box = levels_[level][at];
    const Vector3 nearest = centre_m.cwiseMax(box.least).cwiseMin(box.greatest);
    if ((nearest - centre_m).squaredNorm() > radius_squared_m2) return;
    if (level == 0) {
      for (std::size_t point = kLeaf * at; point < std::min(kLeaf * (at + 1), points_); ++point) visit(point);
      return;
    }
    descend(level - 1, 2 * at, centre_m, radius_squared_m2, visit);
    if (2 * at + 1 < levels_[level - 1].size())
      descend(level - 1, 2 * at + 1, centre_m, radius_squared_m2, visit);
  }

  std::size_t points_;
  std::vector<std::vector<Box>> levels_;  // the leaves, their pairs, pairs of these, ... the whole
};

}  // namespace kiroku::sim
