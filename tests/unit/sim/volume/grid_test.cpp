#include "sim/volume/grid.h"

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/orientations.h"

namespace kiroku::sim {
namespace {

using test::axis_orientations;
using testing::HasSubstr;

Grid some_grid() {
  Grid grid;
  grid.size = {5, 4, 3};
  grid.spacing_m = {0.001, 0.002, 0.0025};
  grid.origin_m = {-0.1, 0.2, 0.3};
  return grid;
}

TEST(Grid, GoesToThePatientAndBackInEveryOrientation) {
  for (const Eigen::Matrix3d& direction : axis_orientations()) {
    Grid grid = some_grid();
    grid.direction = direction;
    EXPECT_EQ(grid.patient_m(Vector3::Zero()), grid.origin_m);
    const Vector3 index(2.25, 3, 1.5);
    const Vector3 at = grid.patient_m(index);
    EXPECT_TRUE(at.isApprox(grid.origin_m + 2.25 * 0.001 * direction.col(0) + 3 * 0.002 * direction.col(1) +
                            1.5 * 0.0025 * direction.col(2)));
    EXPECT_TRUE(grid.index(at).isApprox(index, 1e-12));
  }
}

TEST(Grid, NamesItsOrientation) {
  Grid grid = some_grid();
  EXPECT_EQ(orientation_code(grid), "LPS");
  grid.direction << -1, 0, 0, 0, 0, -1, 0, 1, 0;
  EXPECT_EQ(orientation_code(grid), "RSA");
  EXPECT_EQ(oblique_angle_rad(grid), 0);
  grid.direction = Eigen::AngleAxisd(0.3, Vector3::UnitX()).toRotationMatrix();
  EXPECT_EQ(orientation_code(grid), "LPS");
  EXPECT_NEAR(oblique_angle_rad(grid), 0.3, 1e-12);
}

TEST(Grid, MakesRoundedDirectionsOrthonormalAndLeavesExactOnes) {
  Grid grid = some_grid();
  grid.direction = Eigen::AngleAxisd(0.3, Vector3(1, 2, 3).normalized()).toRotationMatrix();
  const Eigen::Matrix3d exact = grid.direction;
  grid.direction = (exact * 1000).array().round() / 1000;
  make_sound(grid, "it");
  EXPECT_LT((grid.direction.transpose() * grid.direction - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(),
            1e-14);
  EXPECT_LT((grid.direction - exact).cwiseAbs().maxCoeff(), 1e-3);
  for (const Eigen::Matrix3d& direction : axis_orientations()) {
    grid.direction = direction;
    make_sound(grid, "it");
    EXPECT_EQ(grid.direction, direction);
  }
}

TEST(Grid, RefusesWhatIsNoGrid) {
  const auto refusal = [](const std::function<void(Grid&)>& change) -> std::string {
    Grid grid = some_grid();
    change(grid);
    try {
      make_sound(grid, "it");
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal([](Grid& grid) { grid.size[1] = 0; }), HasSubstr("it: it has no voxels"));
  EXPECT_THAT(refusal([](Grid& grid) {
                grid.size = {1U << 20U, 1U << 20U, 1U << 30U};
              }),
              HasSubstr("1048576 x"));
  EXPECT_THAT(refusal([](Grid& grid) { grid.spacing_m.z() = 0; }), HasSubstr("1 x 2 x 0 mm"));
  EXPECT_THAT(refusal([](Grid& grid) { grid.spacing_m.z() = std::nan(""); }), HasSubstr("nan mm"));
  EXPECT_THAT(refusal([](Grid& grid) { grid.origin_m.x() = std::nan(""); }), HasSubstr("not finite"));
  EXPECT_THAT(refusal([](Grid& grid) { grid.direction(0, 1) = 0.3; }), HasSubstr("right angles"));
  EXPECT_THAT(refusal([](Grid& grid) { grid.direction *= 2; }), HasSubstr("unit vectors"));
}

TEST(Grid, KnowsWhetherTwoAreAtTheSamePlaces) {
  const Grid grid = some_grid();
  Grid other = grid;
  EXPECT_TRUE(same_places(grid, other));
  other.origin_m.x() += 5e-6;
  EXPECT_TRUE(same_places(grid, other));
  other.origin_m.x() += 1e-4;
  EXPECT_FALSE(same_places(grid, other));
  other = grid;
  other.size[0] = 6;
  EXPECT_FALSE(same_places(grid, other));
}

}  // namespace
}  // namespace kiroku::sim
