#include "sim/cutting/sweep_surface.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/cutting/blade_path.h"

namespace kiroku::sim {
namespace {

/// The edge from (0, 0, 0) to (0, 1, 0) that moves along x: the unit square in z = 0, its normal along -z.
const SweepSurface kSquare({{0, 0, 0}, {0, 1, 0}}, {{1, 0, 0}, {1, 1, 0}});

TEST(SweepSurface, IsCrossedFromEitherSide) {
  const Vector3 below(0.3, 0.6, -1), above(0.4, 0.5, 2);
  EXPECT_EQ(kSquare.crossing(below, above), 1);
  EXPECT_EQ(kSquare.crossing(above, below), -1);
  EXPECT_EQ(kSquare.nearest(above).normal, Vector3(0, 0, -1));
  EXPECT_DOUBLE_EQ(kSquare.area_m2(), 1);
}

TEST(SweepSurface, IsMissedBesideItsBordersAndByEdgesThatDoNotReachIt) {
  for (const auto& [x, y] : {std::pair{-0.1, 0.5}, {1.1, 0.5}, {0.5, -0.1}, {0.5, 1.1}})
    EXPECT_EQ(kSquare.crossing({x, y, -1}, {x, y, 1}), 0) << x << " " << y;
  EXPECT_EQ(kSquare.crossing({0.5, 0.5, 0.1}, {0.5, 0.5, 1}), 0);
  EXPECT_EQ(kSquare.crossing({0.2, 0.5, 0}, {0.7, 0.5, 0}), 0);  // within it
}

TEST(SweepSurface, CountsItsDiagonalAndItsFirstEdgeNotItsOtherBorders) {
  const auto crossed_at = [](double x, double y) { return kSquare.crossing({x, y, -1}, {x, y, 1}); };
  EXPECT_EQ(crossed_at(0.5, 0.5), 1);  // on the diagonal
  EXPECT_EQ(crossed_at(0, 0.5), 1);    // where the sweep begins
  EXPECT_EQ(crossed_at(1, 0.5), 0);    // where it ends: the next one begins there
  EXPECT_EQ(crossed_at(0.5, 0), 0);
  EXPECT_EQ(crossed_at(0.5, 1), 0);
}

TEST(SweepSurface, CountsAPointOnItAsBeforeIt) {
  EXPECT_EQ(kSquare.crossing({0.3, 0.6, 0}, {0.3, 0.6, 1}), 1);
  EXPECT_EQ(kSquare.crossing({0.3, 0.6, 0}, {0.3, 0.6, -1}), 0);
  EXPECT_EQ(kSquare.crossing({0.3, 0.6, 1e-15}, {0.3, 0.6, -1}), 0);  // rounding decides nothing
}

TEST(SweepSurface, OfABladeThatTurnsAboutItsHeelIsOneTriangle) {
  const SweepSurface pivot({{1, 0, 0}, {0, 0, 0}}, {{0, 1, 0}, {0, 0, 0}});
  EXPECT_DOUBLE_EQ(pivot.area_m2(), 0.5);
  EXPECT_NE(pivot.crossing({0.2, 0.2, -1}, {0.2, 0.2, 1}), 0);
  EXPECT_NE(pivot.crossing({0.5, 0, -1}, {0.5, 0, 1}), 0);  // where it begins
  EXPECT_EQ(pivot.crossing({0, 0.5, -1}, {0, 0.5, 1}), 0);  // where it ends
  EXPECT_EQ(pivot.crossing({0.7, 0.7, -1}, {0.7, 0.7, 1}), 0);
}

TEST(SweepSurface, FindsItsNearestPoint) {
  EXPECT_TRUE(kSquare.nearest({0.25, 0.5, 3}).point.isApprox(Vector3(0.25, 0.5, 0)));
  EXPECT_TRUE(kSquare.nearest({2, 0.5, 1}).point.isApprox(Vector3(1, 0.5, 0)));
  EXPECT_TRUE(kSquare.nearest({-1, -1, 0}).point.isApprox(Vector3::Zero()));
}

std::string refusal(const std::vector<BladePose>& path) {
  try {
    sweep_surfaces(path);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

TEST(BladePath, RefusesWhatSweepsNoSurface) {
  const BladePose pose{{0, 0, 0}, {0, 1, 0}}, along{{0, 0.5, 0}, {0, 1.5, 0}}, point{{1, 1, 1}, {1, 1, 1}};
  EXPECT_EQ(refusal({}), "a blade's path has 0 poses: a cut needs two at least");
  EXPECT_EQ(refusal({pose}), "a blade's path has 1 poses: a cut needs two at least");
  EXPECT_EQ(refusal({pose, pose}),
            "from pose 0 to 1 the blade's edge does not move, or only along itself: it sweeps no surface");
  EXPECT_THAT(refusal({pose, along}), testing::HasSubstr("only along itself"));
  EXPECT_EQ(refusal({pose, {{1, 0, 0}, {1, 1, 0}}, point}),
            "from pose 1 to 2 the blade's edge has no length: its tip and its heel are one point");
  EXPECT_THAT(refusal({pose, {{NAN, 0, 0}, {1, 1, 0}}}), testing::HasSubstr("is not finite"));
  EXPECT_THAT(refusal({pose, {{INFINITY, 0, 0}, {1, 1, 0}}}), testing::HasSubstr("is not finite"));
}

}  // namespace
}  // namespace kiroku::sim
