// Distances that are known, or found by trying all voxels.
#include "sim/volume/distance_field.h"

#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

Grid oblique_grid() {
  Grid grid;
  grid.size = {9, 7, 6};
  grid.spacing_m = {0.001, 0.002, 0.0035};
  grid.origin_m = {0.01, -0.02, 0.3};
  grid.direction = Eigen::AngleAxisd(0.6, Vector3(1, 2, 3).normalized()).toRotationMatrix();
  return grid;
}

Vector3 centre(const Grid& grid, std::size_t offset) {
  return grid.patient_m({double(offset % grid.size[0]), double(offset / grid.size[0] % grid.size[1]),
                         double(offset / (grid.size[0] * grid.size[1]))});
}

TEST(DistanceFieldTest, IsTheNearestOfAllVoxels) {
  const Grid grid = oblique_grid();
  std::mt19937 random(2);
  for (const unsigned rarity : {2U, 20U, 150U}) {
    std::vector<std::uint8_t> marked(grid.voxels());
    for (std::uint8_t& mark : marked) mark = random() % rarity == 0 ? 1 : 0;
    marked[17] = 1;
    const std::vector<float> found = distances_m(grid, marked);
    for (std::size_t i = 0; i < marked.size(); ++i) {
      double least = 1;
      for (std::size_t j = 0; j < marked.size(); ++j) {
        if (marked[j] != 0) least = std::min(least, (centre(grid, i) - centre(grid, j)).norm());
      }
      EXPECT_NEAR(double(found[i]), least, 1e-8);
    }
  }
}

TEST(DistanceFieldTest, NothingMarkedIsInfinitelyFar) {
  const Grid grid = oblique_grid();
  for (const float distance : distances_m(grid, std::vector<std::uint8_t>(grid.voxels())))
    EXPECT_TRUE(std::isinf(distance));
}

TEST(DistanceFieldTest, ABallsSurfaceIsWhereItIs) {
  constexpr double kRadiusM = 0.03;
  LabelMap ball;
  ball.grid.size = {60, 60, 40};
  ball.grid.spacing_m = {0.0015, 0.0015, 0.0025};
  const Vector3 middle(0.045, 0.044, 0.05);
  ball.labels.resize(ball.grid.voxels());
  for (std::size_t i = 0; i < ball.labels.size(); ++i)
    ball.labels[i] = (centre(ball.grid, i) - middle).norm() < kRadiusM ? 7 : 0;
  const DistanceField field = signed_distance(ball);
  std::mt19937 random(4);
  const auto part = [&] { return double(random()) / 2147483648.0 - 1; };
  double squares = 0, bias = 0;
  for (int i = 0; i < 500; ++i) {
    const double x = part(), y = part(), z = part();
    const Vector3 direction = Vector3(x, y, z).normalized();
    const SignedDistance at = sample(field, middle + kRadiusM * direction);
    squares += at.distance_m * at.distance_m / 500;
    bias += at.distance_m / 500;
    EXPECT_GT(at.gradient.normalized().dot(direction), 0.7);
  }
  EXPECT_LT(std::sqrt(squares), 0.0005);
  EXPECT_LT(std::abs(bias), 0.0002);
  EXPECT_LT(sample(field, middle).distance_m, -0.028);
  // Beyond the field the distance grows on.
  EXPECT_NEAR(sample(field, middle + Vector3(0, 0, 1)).distance_m, 1 - kRadiusM, 0.002);
}

TEST(DistanceFieldTest, WithoutASurfaceThereIsNone) {
  LabelMap map{oblique_grid(), {}};
  map.labels.assign(map.grid.voxels(), 0);
  EXPECT_THROW(static_cast<void>(signed_distance(map)), Error);
  map.labels.assign(map.grid.voxels(), 3);
  EXPECT_THROW(static_cast<void>(signed_distance(map)), Error);
}

}  // namespace
}  // namespace kiroku::sim
