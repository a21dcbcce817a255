#include "sim/render/plan_scene.h"

#include <numbers>

#include <gtest/gtest.h>

#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

Plan plan_with(ToolKind kind, Tool tool, double edge_m = 0) {
  Plan plan;
  plan.tools.push_back({kind, std::move(tool), edge_m});
  return plan;
}

PlanFrame frame_at(const Vector3& position_m,
                   const Eigen::Quaterniond& orientation = Eigen::Quaterniond::Identity()) {
  PlanFrame frame;
  frame.poses.emplace_back(Pose{position_m, orientation});
  return frame;
}

TEST(PlanScene, ShowsToolsThatAreThere) {
  const Plan plan = plan_with(ToolKind::kFinger, finger("index", 0.01));
  const std::vector<Solid> solids = tools_of(plan, frame_at({1, 2, 3}));
  ASSERT_EQ(solids.size(), 1U);
  EXPECT_EQ(std::get<Sphere>(solids[0].shape).radius_m, 0.01);
  EXPECT_EQ(solids[0].pose.position_m, Vector3(1, 2, 3));
  PlanFrame away;
  away.poses.resize(1);
  EXPECT_TRUE(tools_of(plan, away).empty());
}

TEST(PlanScene, ShowsJawsAsPlatesBesideWhatTheyHold) {
  const Plan plan = plan_with(ToolKind::kForceps, forceps("forceps", {0.012, 0.012, 0.008}));
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3::UnitX()));
  const std::vector<Solid> solids = tools_of(plan, frame_at(Vector3::Zero(), turn));
  ASSERT_EQ(solids.size(), 2U);
  // The shortest edge, z, lies along y now.
  EXPECT_LT((solids[0].pose.position_m + solids[1].pose.position_m).norm(), 1e-12);
  EXPECT_NEAR(std::abs(solids[0].pose.position_m.y()), 0.009, 1e-12);
}

TEST(PlanScene, ShowsABladeAlongItsEdge) {
  const Plan plan = plan_with(ToolKind::kScalpel, Tool{}, 0.036);
  const std::vector<Solid> solids = tools_of(plan, frame_at({0.1, 0, 0}));
  ASSERT_EQ(solids.size(), 1U);
  EXPECT_NEAR(std::get<Box>(solids[0].shape).half_extent_m.z(), 0.018, 1e-12);
  EXPECT_LT((solids[0].pose.position_m - Vector3(0.1, 0, 0.018)).norm(), 1e-12);
}

TEST(PlanScene, MarksNodesThatToolsActOn) {
  const TetMesh mesh = test::tet_grid({1, 1, 1}, {1, 1, 1});
  PlanFrame frame;
  frame.tool_force_n = Eigen::VectorXd::Zero(24);
  frame.displacement_m = Eigen::VectorXd::Constant(24, 0.5);
  frame.tool_force_n[3 * 7 + 1] = 1e-9;
  const std::vector<Solid> points = contact_points_of(mesh, frame, 0.02);
  ASSERT_EQ(points.size(), 1U);
  EXPECT_EQ(points[0].pose.position_m, Vector3::Constant(1.5));
}

}  // namespace
}  // namespace kiroku::sim
