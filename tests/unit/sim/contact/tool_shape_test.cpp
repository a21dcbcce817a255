#include "sim/contact/tool_shape.h"

#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::sim {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

TEST(ToolShape, DistancesAreThoseOfTheShapes) {
  EXPECT_DOUBLE_EQ(distance_to(Sphere{0.01}, {0, 0, 0.03}).distance_m, 0.02);
  EXPECT_EQ(distance_to(Sphere{0.01}, {0, 0, 0.03}).normal, Vector3::UnitZ());
  EXPECT_DOUBLE_EQ(distance_to(Capsule{0.01, 0.02}, {0.03, 0, 0.015}).distance_m, 0.02);
  EXPECT_EQ(distance_to(Capsule{0.01, 0.02}, {0, 0, -0.05}).normal, -Vector3::UnitZ());
  const Box plate{{0.02, 0.03, 0.001}};
  EXPECT_DOUBLE_EQ(distance_to(plate, {0, 0, -0.0005}).distance_m, -0.0005);
  EXPECT_EQ(distance_to(plate, {0, 0, -0.0005}).normal, -Vector3::UnitZ());
  EXPECT_DOUBLE_EQ(distance_to(plate, {0.023, 0.034, 0}).distance_m, 0.005);
}

TEST(ToolShape, NormalsAreTheGradientsAndDistancesAreConvex) {
  std::mt19937 random(3);
  const auto number = [&] { return (static_cast<double>(random()) / 4294967296.0 - 0.5) * 0.1; };
  for (const ToolShape& shape :
       {ToolShape(Sphere{0.02}), ToolShape(Capsule{0.01, 0.02}), ToolShape(Box{{0.01, 0.03, 0.02}})}) {
    for (int i = 0; i < 500; ++i) {
      const Vector3 a(number(), number(), number()), b(number(), number(), number());
      const SurfaceDistance at_a = distance_to(shape, a);
      EXPECT_NEAR(at_a.normal.norm(), 1, 1e-14);
      // On the line from a to the surface, the distance shrinks as fast as one goes.
      EXPECT_NEAR(distance_to(shape, a - at_a.distance_m * at_a.normal).distance_m, 0, 1e-15);
      // What contact stands on: the plane through the nearest point never tells more than the distance.
      EXPECT_GE(distance_to(shape, b).distance_m, at_a.distance_m + at_a.normal.dot(b - a) - 1e-15);
      EXPECT_LE(at_a.distance_m, a.norm());
      EXPECT_GE(at_a.distance_m, a.norm() - bounding_radius_m(shape) - 1e-15);
    }
  }
}

TEST(ToolShape, AWayOutIsChosenInTheMiddle) {
  for (const ToolShape& shape :
       {ToolShape(Sphere{0.02}), ToolShape(Capsule{0.02, 0.01}), ToolShape(Box{{0.02, 0.02, 0.02}})}) {
    EXPECT_DOUBLE_EQ(distance_to(shape, Vector3::Zero()).distance_m, -0.02);
    EXPECT_EQ(distance_to(shape, Vector3::Zero()).normal, Vector3::UnitX());
  }
}

TEST(ToolShape, RefusesWhatHasNoExtent) {
  EXPECT_EQ(problem_of(Sphere{0.01}), "");
  EXPECT_EQ(problem_of(Sphere{0}), "its radius is 0 m: it must be greater than zero");
  EXPECT_EQ(problem_of(Sphere{kNone}), "its radius is nan m: it must be greater than zero");
  EXPECT_EQ(problem_of(Capsule{0.01, 0}), "");
  EXPECT_EQ(problem_of(Capsule{0.01, -1}), "its half length is -1 m: it must not be negative");
  EXPECT_EQ(problem_of(Capsule{-0.01, 0}), "its radius is -0.01 m: it must be greater than zero");
  EXPECT_EQ(problem_of(Box{{1, 1, 0}}), "its half extent is 0 m: it must be greater than zero");
}

TEST(Pose, GoesThereAndBack) {
  const Pose pose{{1, 2, 3}, Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vector3(1, 2, -1).normalized()))};
  EXPECT_TRUE(pose.sound());
  const Vector3 point(0.3, -0.2, 0.1);
  EXPECT_LE((pose.to_tool(pose.from_tool(point)) - point).norm(), 1e-15);
  EXPECT_FALSE((Pose{{kNone, 0, 0}, {}}.sound()));
  EXPECT_FALSE((Pose{{0, 0, 0}, {2, 0, 0, 0}}.sound()));
}

}  // namespace
}  // namespace kiroku::sim
