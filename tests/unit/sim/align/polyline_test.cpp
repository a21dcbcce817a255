#include "sim/align/polyline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::sim {
namespace {

using Eigen::Vector2d;
using testing::ElementsAre;

// A place is given twice: its piece has no length.
const std::vector<Vector2d> kCorner{{0, 0}, {4, 0}, {4, 0}, {4, 2}};

TEST(Polyline, PlacesAreSpreadEvenlyOverItsLength) {
  EXPECT_EQ(polyline_length(kCorner), 6);
  EXPECT_THAT(spread_over_polyline(kCorner, 4),
              ElementsAre(Vector2d(0, 0), Vector2d(2, 0), Vector2d(4, 0), Vector2d(4, 2)));
  const std::vector<Eigen::Vector3d> in_space{{0, 0, 0}, {0, 0, 2}};
  EXPECT_THAT(spread_over_polyline(in_space, 2), ElementsAre(in_space[0], in_space[1]));
}

TEST(Polyline, TheNearestPlaceLiesOnAPieceOrAtAnEnd) {
  const NearestOnPolyline beside = nearest_on_polyline(kCorner, {1, 3});
  EXPECT_EQ(beside.at, Vector2d(1, 0));
  EXPECT_EQ(beside.segment, 0U);
  EXPECT_EQ(beside.share, 0.25);
  EXPECT_EQ(beside.squared_px2, 9);
  EXPECT_FALSE(beside.is_end);
  EXPECT_EQ(nearest_on_polyline(kCorner, {5, 1}).at, Vector2d(4, 1));
  const NearestOnPolyline beyond = nearest_on_polyline(kCorner, {4, 5});
  EXPECT_EQ(beyond.at, Vector2d(4, 2));
  EXPECT_TRUE(beyond.is_end);
  EXPECT_FALSE(nearest_on_polyline(kCorner, {5, -1}).is_end) << "the corner is none";
}

}  // namespace
}  // namespace kiroku::sim
