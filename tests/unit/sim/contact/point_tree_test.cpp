#include "sim/contact/point_tree.h"

#include <numeric>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sim/fem/compliance.h"

namespace kiroku::sim {
namespace {

TEST(PointTree, FindsWhatIsNearAlsoAfterThePointsMoved) {
  std::mt19937 random(9);
  const auto number = [&] { return static_cast<double>(random()) / 4294967296.0; };
  for (const std::size_t count : {0U, 1U, 8U, 9U, 100U, 777U}) {
    std::vector<Vector3> points(count);
    for (Vector3& point : points) point = {number(), number(), number()};
    std::vector<std::uint32_t> all(count);
    std::iota(all.begin(), all.end(), 0U);
    std::vector<std::uint32_t> order;
    for (const auto& group : neighbouring_groups(points, all, PointTree::kLeaf)) {
      EXPECT_LE(group.size(), PointTree::kLeaf);
      order.insert(order.end(), group.begin(), group.end());
    }
    EXPECT_THAT(order, testing::UnorderedElementsAreArray(all));
    PointTree tree(count);
    Eigen::VectorXd positions_m(static_cast<Eigen::Index>(3 * count));
    std::size_t visited = 0, near = 0;
    for (int move = 0; move < 5; ++move) {
      for (std::size_t i = 0; i < count; ++i) {
        points[order[i]] += 0.05 * Vector3(number(), number(), number());
        positions_m.segment<3>(static_cast<Eigen::Index>(3 * i)) = points[order[i]];
      }
      tree.refit(positions_m);
      const Vector3 centre_m(number(), number(), number());
      const double radius_m = 0.3 * number();
      std::vector<std::size_t> found;
      tree.visit_near(centre_m, radius_m, [&](std::size_t point) { found.push_back(point); });
      EXPECT_TRUE(std::ranges::is_sorted(found));
      visited += found.size();
      for (std::size_t i = 0; i < count; ++i) {
        if ((points[order[i]] - centre_m).norm() > radius_m) continue;
        ++near;
        EXPECT_TRUE(std::ranges::binary_search(found, i)) << i;
      }
    }
    if (count == 777) {
      EXPECT_GT(near, 10U);
      EXPECT_LT(visited, 5 * count / 2);  // it spares most of them
    }
  }
}

}  // namespace
}  // namespace kiroku::sim
