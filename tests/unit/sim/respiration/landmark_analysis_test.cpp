// Errors at landmarks that are known by construction, taken apart again.
#include "sim/respiration/landmark_analysis.h"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

std::vector<Vector3> scattered(std::size_t count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> part(0.01, 0.09);
  std::vector<Vector3> points;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = part(random), y = part(random), z = part(random);
    points.emplace_back(x, y, z);
  }
  return points;
}

LandmarkPairs moved(std::size_t count, const std::function<Vector3(const Vector3&)>& motion) {
  LandmarkPairs pairs{scattered(count), {}};
  for (const Vector3& point : pairs.fixed_m) pairs.moving_m.push_back(motion(point));
  return pairs;
}

const LandmarkBound& named(const std::vector<LandmarkBound>& bounds, const std::string& name) {
  for (const LandmarkBound& bound : bounds) {
    if (bound.name == name) return bound;
  }
  throw Error("no " + name);
}

TEST(LandmarkBounds, ATransformLeavesNothingOfAMotionOfItsKindAndSomethingOfAFreerOne) {
  const Eigen::AngleAxisd turn(0.3, Vector3(1, 2, 3).normalized());
  const Vector3 by(0.02, 0.01, -0.03);
  const auto rigid = landmark_bounds(moved(30, [&](const Vector3& p) { return Vector3(turn * p + by); }));
  EXPECT_GT(named(rigid, "translation").fitted_m.mean, 0.001);
  for (const char* name : {"rigid", "affine", "quadratic", "thin-plate spline"}) {
    EXPECT_LT(named(rigid, name).fitted_m.greatest, 1e-9) << name;
    EXPECT_LT(named(rigid, name).left_out_m.greatest, 1e-9) << name;
  }
  const auto stretched =
      landmark_bounds(moved(30, [](const Vector3& p) { return Vector3(p.x(), 1.2 * p.y(), p.z()); }));
  EXPECT_GT(named(stretched, "rigid").fitted_m.mean, 0.001);
  EXPECT_LT(named(stretched, "affine").left_out_m.greatest, 1e-9);
  const auto bent = landmark_bounds(
      moved(30, [](const Vector3& p) { return Vector3(p.x() + 3 * p.y() * p.z(), p.y(), p.z()); }));
  EXPECT_GT(named(bent, "affine").fitted_m.mean, 0.0005);
  EXPECT_LT(named(bent, "quadratic").left_out_m.greatest, 1e-9);
  EXPECT_LT(named(bent, "thin-plate spline").fitted_m.greatest, 1e-9);
  // Between its landmarks a spline guesses.
  EXPECT_GT(named(bent, "thin-plate spline").left_out_m.mean, 1e-5);
}

TEST(LandmarkBounds, OnlyTransformsThatTheLandmarksDetermineAreTold) {
  const auto still = [](const Vector3& p) { return p; };
  EXPECT_TRUE(landmark_bounds(moved(3, still)).empty());
  EXPECT_EQ(landmark_bounds(moved(4, still)).size(), 2U);
  EXPECT_EQ(landmark_bounds(moved(10, still)).size(), 4U);
  EXPECT_EQ(landmark_bounds(moved(11, still)).size(), 5U);
}

struct Placed {
  TetMesh mesh = test::tet_grid({5, 5, 5}, {0.1, 0.1, 0.1});
  std::vector<ShapeFitStep> steps;
  explicit Placed(const Vector3& off_m) {
    for (const Vector3& by_m : {Vector3(0, 0, 0), off_m}) {
      ShapeFitStep step;
      step.name = steps.empty() ? "rigid" : "sliding boundary";
      step.displacement_m = by_m.replicate(static_cast<Eigen::Index>(mesh.nodes.size()), 1);
      steps.push_back(step);
    }
  }
};

TEST(LandmarkDecomposition, AnErrorThatIsTheSameEverywhereIsItsMean) {
  const Vector3 off_m(0.001, -0.002, 0.002);
  const Placed lung(off_m);
  LandmarkPairs pairs = moved(20, [](const Vector3& p) { return p; });
  pairs.fixed_m.emplace_back(1, 1, 1);
  pairs.moving_m.emplace_back(1, 1, 1);
  const LandmarkErrors errors = errors_at(pairs, lung.mesh, lung.steps);
  EXPECT_EQ(errors.outside, 1U);
  EXPECT_EQ(errors.inside.fixed_m.size(), 20U);
  const LandmarkDecomposition parts = decompose(errors, 1);
  EXPECT_LT((parts.mean_m - off_m).norm(), 1e-12);
  EXPECT_LT(parts.without_mean_m.greatest, 1e-12);
  for (const NamedSpread& third : parts.by_height) EXPECT_NEAR(third.spread_m.mean, 0.003, 1e-12);
  ASSERT_EQ(parts.by_depth.size(), 3U);
  EXPECT_EQ(
      parts.by_depth[0].spread_m.count + parts.by_depth[1].spread_m.count + parts.by_depth[2].spread_m.count,
      20U);
}

TEST(LandmarkDecomposition, AlongAndAcrossTheNearestSurface) {
  const Placed lung(Vector3(0.003, 0.004, 0));
  LandmarkPairs pairs;
  pairs.fixed_m = pairs.moving_m = {{0.099, 0.06, 0.06}};  // nearest to the middle of the face at x = 0.1
  const LandmarkDecomposition parts = decompose(errors_at(pairs, lung.mesh, lung.steps), 1);
  EXPECT_NEAR(parts.along_normal_m.mean, 0.003, 1e-9);
  EXPECT_NEAR(parts.across_m.mean, 0.004, 1e-9);
  // Of one landmark there are no thirds, of which two would have no error at all.
  for (const auto* groups : {&parts.by_height, &parts.by_depth}) {
    ASSERT_EQ(groups->size(), 1U);
    EXPECT_NEAR(groups->front().spread_m.mean, 0.005, 1e-9);
  }
}

TEST(LandmarkDecomposition, NoLandmarkIsRefused) {
  const Placed lung(Vector3::Zero());
  EXPECT_THROW(static_cast<void>(decompose(errors_at({}, lung.mesh, lung.steps), 1)), Error);
}

TEST(LandmarkCsv, HasALineForEachLandmarkAndItsNumbersAddUp) {
  const Placed lung(Vector3(0.003, 0.004, 0));
  LandmarkPairs pairs;
  pairs.fixed_m = pairs.moving_m = {{0.05, 0.06, 0.04}};
  const LandmarkErrors errors = errors_at(pairs, lung.mesh, lung.steps);
  const std::string text = landmark_csv(errors, lung.steps);
  EXPECT_THAT(text, testing::StartsWith("x_mm,y_mm,z_mm,depth_mm,rigid_x_mm,rigid_y_mm,rigid_z_mm,rigid_mm,"
                                        "sliding_boundary_x_mm,"));
  EXPECT_THAT(text, testing::HasSubstr("\n50,60,40,"));
  EXPECT_THAT(text, testing::EndsWith(",3,4,0,5\n"));
  EXPECT_THAT(landmark_plot(errors, lung.steps), testing::HasSubstr("sliding boundary"));
}

}  // namespace
}  // namespace kiroku::sim
