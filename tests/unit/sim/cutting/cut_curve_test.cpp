#include "sim/cutting/cut_curve.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/cutting/blade_path.h"
#include "sim/cutting/vertex_preserving_cut.h"
#include "tests/support/ball_mesh.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

constexpr double kRadiusM = 0.05, kEdgeM = 0.04, kSpacingM = 0.006;

TetMesh ball() { return test::ball_mesh({12, 12, 12}, Vector3::Zero(), Vector3::Constant(kRadiusM)); }

/// On the ball, by angles from the x axis.
Vector3 on_ball(double along_degrees, double up_degrees) {
  const double along = along_degrees * std::numbers::pi / 180, up = up_degrees * std::numbers::pi / 180;
  return kRadiusM * Vector3(std::cos(up) * std::cos(along), std::cos(up) * std::sin(along), std::sin(up));
}

CutCurve across() {
  return {{on_ball(-40, 0), on_ball(-10, 25), on_ball(15, -5), on_ball(45, 10)}, true, {0.012}, {}};
}

std::string curve_refusal(const CutCurve& curve) {
  try {
    (void)blade_along(curve, ball(), kEdgeM, kSpacingM);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

double nearest_m(const std::vector<BladePose>& path, const Vector3& place_m) {
  double least_m = 1;
  for (const BladePose& pose : path) {
    // Where the edge goes through the surface.
    const Vector3 entry_m = kRadiusM * (pose.tip + (pose.heel - pose.tip) * 0.3).normalized();
    least_m = std::min(least_m, (entry_m - place_m).norm());
  }
  return least_m;
}

TEST(CutCurve, GoesThroughItsHandlesAlongTheSurfaceAtItsDepth) {
  const CutCurve curve = across();
  const std::vector<BladePose> path = blade_along(curve, ball(), kEdgeM, kSpacingM);
  ASSERT_GT(path.size(), 12U);
  for (const BladePose& pose : path) {
    // The facets of the ball lie a little inside of it.
    EXPECT_NEAR(pose.tip.norm(), kRadiusM - 0.012, 0.001);
    EXPECT_NEAR((pose.heel - pose.tip).norm(), kEdgeM, 1e-12);
    EXPECT_GT(pose.heel.norm(), kRadiusM);
    EXPECT_GT(pose.tip.normalized().dot((pose.heel - pose.tip).normalized()), 0.98) << "inward";
  }
  for (const Vector3& handle_m : curve.handles_m) EXPECT_LT(nearest_m(path, handle_m), 0.6 * kSpacingM);
  EXPECT_LT((path.front().tip.normalized() - curve.handles_m.front().normalized()).norm(), 0.05);
  EXPECT_LT((path.back().tip.normalized() - curve.handles_m.back().normalized()).norm(), 0.05);
  // Even steps.
  for (std::size_t i = 1; i < path.size(); ++i) {
    const double step_m = (path[i].tip - path[i - 1].tip).norm() * kRadiusM / (kRadiusM - 0.012);
    EXPECT_NEAR(step_m, kSpacingM, 0.35 * kSpacingM);
  }
}

TEST(CutCurve, AStraightOneHasCornersAndASmoothOneDoesNot) {
  const auto sharpest = [](bool smooth) {
    CutCurve curve = across();
    curve.smooth = smooth;
    const std::vector<BladePose> path = blade_along(curve, ball(), kEdgeM, 0.002);
    double least = 1;
    for (std::size_t i = 2; i < path.size(); ++i) {
      const Vector3 before = path[i - 1].tip - path[i - 2].tip, after = path[i].tip - path[i - 1].tip;
      least = std::min(least, before.normalized().dot(after.normalized()));
    }
    return least;
  };
  EXPECT_GT(sharpest(true), sharpest(false) + 0.1);
}

TEST(CutCurve, ChangesItsDepthEvenlyFromHandleToHandle) {
  CutCurve curve{{on_ball(-30, 0), on_ball(0, 0), on_ball(30, 0)}, true, {0.004, 0.02, 0.004}, {}};
  const std::vector<BladePose> path = blade_along(curve, ball(), kEdgeM, 0.002);
  for (const BladePose& pose : path) {
    const double along_degrees = std::atan2(pose.tip.y(), pose.tip.x()) * 180 / std::numbers::pi;
    const double depth_m = 0.02 - (0.02 - 0.004) * std::abs(along_degrees) / 30;
    EXPECT_NEAR(kRadiusM - pose.tip.norm(), depth_m, 0.0016) << along_degrees;
  }
}

TEST(CutCurve, GoesTheWayItIsGiven) {
  CutCurve curve = across();
  curve.direction = Vector3(-2, 0, 0);
  for (const BladePose& pose : blade_along(curve, ball(), kEdgeM, kSpacingM))
    EXPECT_LT(((pose.tip - pose.heel).normalized() - Vector3(-1, 0, 0)).norm(), 1e-12);
  curve.direction = Vector3(1, 0, 0);
  EXPECT_THAT(curve_refusal(curve), HasSubstr("leads along the organ's surface or out of it at "));
  curve.direction = Vector3::Zero();
  EXPECT_EQ(curve_refusal(curve), "the direction of the cut has no length");
}

TEST(CutCurve, CutsAsDeepAsItIsTold) {
  for (const double depth_m : {0.01, 0.025}) {
    CutCurve curve = across();
    curve.depth_m = {depth_m};
    VertexPreservingCut cut(ball());
    std::vector<Vector3> opened;
    for (const SweepSurface& sweep : sweep_surfaces(blade_along(curve, ball(), kEdgeM, kSpacingM))) {
      for (const Face& face : cut.cut(sweep).opened) {
        for (const std::uint32_t node : face.nodes) opened.push_back(cut.mesh().nodes[node]);
      }
    }
    ASSERT_FALSE(opened.empty());
    double deepest_m = 0;
    for (const Vector3& node : opened) deepest_m = std::max(deepest_m, kRadiusM - node.norm());
    // As fine as the mesh, whose cells are 8.3 mm.
    EXPECT_NEAR(deepest_m, depth_m, 0.009);
  }
}

TEST(CutCurve, RefusesWhatCannotBeCutInWords) {
  CutCurve curve = across();
  curve.handles_m.resize(1);
  EXPECT_EQ(curve_refusal(curve), "a curve needs two handles at least: it has 1");
  curve = across();
  curve.handles_m.resize(101, curve.handles_m.back());
  EXPECT_EQ(curve_refusal(curve), "a curve has 100 handles at most: it has 101");
  curve = across();
  curve.handles_m[2] *= 1.6;
  EXPECT_THAT(curve_refusal(curve),
              testing::MatchesRegex("handle 2 is 3[01](\\.[0-9])? mm off the organ's surface: "
                                    "place it on it \\([0-9.]+ mm are allowed\\)"));
  curve = across();
  curve.handles_m[1] = curve.handles_m[0];
  EXPECT_EQ(curve_refusal(curve), "handle 1 is where handle 0 is: leave one of them out");
  curve = across();
  curve.handles_m[3].x() = std::nan("");
  EXPECT_EQ(curve_refusal(curve), "handle 3 is not finite");
  curve = across();
  curve.depth_m = {0.01, 0.02};
  EXPECT_EQ(curve_refusal(curve),
            "a curve has one depth for all handles or one for each: it has 2 for 4 handles");
  curve.depth_m = {0};
  EXPECT_EQ(curve_refusal(curve), "a depth of 0 mm cuts nothing: it must be greater than 0");
  curve.depth_m = {0.05};
  EXPECT_EQ(curve_refusal(curve), "a depth of 50 mm needs a blade whose edge is longer: it has 40 mm");
}

}  // namespace
}  // namespace kiroku::sim
