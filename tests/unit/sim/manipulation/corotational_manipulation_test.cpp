// A body that tools turn and press: against direct solves of the same prescribed displacements and forces.
#include "sim/manipulation/corotational_manipulation.h"

#include <numbers>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/mesh/degrees_of_freedom.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

void record_corotational(const char* what, double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2g", value);
  testing::Test::RecordProperty(what, text);
}

const Materials kSoftTissue{{0, {5e3, 0.45}}};
const Vector3 kWeight{0, 0, -0.05};  // almost afloat, so that it sinks by 2 mm and not by 40

/// 80 x 20 x 20 mm, held at x = 0, hanging by its weight.
TetMesh beam() { return test::tet_grid({12, 3, 3}, {0.08, 0.02, 0.02}); }
Constraints held(const TetMesh& mesh) {
  Constraints constraints(mesh.nodes.size());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (mesh.nodes[node].x() == 0) constraints.prescribe(node, Vector3::Zero(), "test");
  }
  return constraints;
}

double volume_m3(TetMesh mesh, const Eigen::VectorXd& displacement_m) {
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node)
    mesh.nodes[node] += displacement_m.segment<3>(first_row(node));
  double sum = 0;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) sum += signed_volume_m3(mesh, t);
  return sum;
}

/// Forceps at the free end, at a part of their way: up, back and turned, as bending a quarter of a circle
/// asks.
Pose turned(double part, double degrees) {
  Pose pose;
  pose.position_m = Vector3(0.08, 0.01, 0.01) + part * Vector3(-0.029, 0, 0.051);
  pose.orientation = Eigen::AngleAxisd(-part * degrees * std::numbers::pi / 180, Vector3::UnitY());
  return pose;
}

class CorotationalManipulationTest : public testing::Test {
 protected:
  TetMesh mesh_ = beam();
  CorotationalBody body_{mesh_, kSoftTissue, held(mesh_)};
  Eigen::VectorXd weight_n_ = body_.linear().weight_n(kWeight);
  std::vector<Tool> tools_{forceps("forceps", {0.001, 0.02, 0.02}), finger("thumb", 0.008),
                           finger("index", 0.008, true), flat_retractor("plate", {0.02, 0.02, 0.002})};
};
constexpr std::size_t kForceps = 0, kThumb = 1, kIndex = 2, kPlate = 3;

TEST_F(CorotationalManipulationTest, AGraspThatTurnsIsTheDirectSolutionAndKeepsTheVolume) {
  CorotationalManipulation hand(body_, weight_n_, tools_);
  EXPECT_LT((hand.displacement_m() - body_.solve(weight_n_).displacement_m).norm(), 1e-15);
  const Vector3 sunk_m = hand.displacement_m().tail<3>();
  Pose at_m = turned(0, 90);
  at_m.position_m.z() += sunk_m.z();
  EXPECT_EQ(hand.grasp(kForceps, at_m), 16U);
  const Eigen::VectorXd before_m = hand.displacement_m();
  hand.step(std::vector<OptionalPose>{at_m, {}, {}, {}});
  EXPECT_LT((hand.displacement_m() - before_m).norm(), 1e-9 * before_m.norm());  // a grasp moves nothing
  Pose end;
  for (int i = 1; i <= 10; ++i) {
    end = turned(i / 10.0, 90);
    hand.step(std::vector<OptionalPose>{end, {}, {}, {}});
    EXPECT_GT(hand.factorisations(), 0);
  }
  // The same as one body with these nodes prescribed, which gets there on another way.
  Constraints prescribed = held(mesh_);
  for (const BoundNode& bound : hand.result().bound) {
    prescribed.prescribe(bound.node, hand.displacement_m().segment<3>(first_row(bound.node)), "test");
    const Vector3 from_m = mesh_.nodes[bound.node] + before_m.segment<3>(first_row(bound.node));
    EXPECT_LT((end.from_tool(at_m.to_tool(from_m)) - mesh_.nodes[bound.node] -
               hand.displacement_m().segment<3>(first_row(bound.node)))
                  .norm(),
              1e-15);
  }
  const CorotationalBody direct(mesh_, kSoftTissue, prescribed);
  const CorotationalBody::Solution solved = direct.solve(weight_n_);
  const double displacement =
      (hand.displacement_m() - solved.displacement_m).norm() / solved.displacement_m.norm();
  record_corotational("displacement", displacement);
  EXPECT_LT(displacement, 1e-8);
  Vector3 reaction_n = Vector3::Zero();
  for (const BoundNode& bound : hand.result().bound)
    reaction_n += solved.reaction_force_n.segment<3>(first_row(bound.node));
  const double force = (hand.result().tools[kForceps].force_n + reaction_n).norm() / reaction_n.norm();
  record_corotational("force", force);
  EXPECT_LT(force, 1e-8);
  // Linear elements do not know that they turn.
  const double rest_m3 = volume_m3(mesh_, Eigen::VectorXd::Zero(weight_n_.size()));
  const double swelling = volume_m3(mesh_, hand.displacement_m()) / rest_m3 - 1;
  const ElasticBody linear(mesh_, kSoftTissue, prescribed);
  const double linear_swelling = volume_m3(mesh_, linear.solve(weight_n_).displacement_m) / rest_m3 - 1;
  record_corotational("swelling", swelling);
  record_corotational("linear_swelling", linear_swelling);
  EXPECT_LT(std::abs(swelling), 0.02);
  EXPECT_GT(std::abs(linear_swelling), 0.2);

  hand.release(kForceps);
  hand.step(std::vector<OptionalPose>(4));
  EXPECT_LT((hand.displacement_m() - before_m).norm(), 1e-7 * before_m.norm());
}

TEST_F(CorotationalManipulationTest, PressedAndTurnedItIsInEquilibriumAndOutsideOfItsTools) {
  CorotationalManipulation hand(body_, weight_n_, tools_);
  Pose grasped = turned(0, 60);
  grasped.position_m.z() += hand.displacement_m().tail<3>().z();
  hand.grasp(kForceps, grasped);
  const double size_m = 0.08;
  std::size_t most_stuck = 0;
  for (int i = 0; i <= 10; ++i) {
    std::vector<OptionalPose> poses(4);
    poses[kForceps] = i == 0 ? grasped : turned(i / 10.0, 60);
    Pose thumb, index, plate;
    thumb.position_m = {0.035, 0.01, 0.034 - 0.0005 * i};
    index.position_m = {0.045, 0.029 - 0.0004 * i, 0.01 + 0.0003 * i};
    plate.position_m = {0.03, 0.01, -0.006 + 0.0005 * i};
    poses[kThumb] = thumb;
    poses[kIndex] = index;
    poses[kPlate] = plate;
    const ManipulationResult& result = hand.step(poses);
    EXPECT_TRUE(result.converged) << i;
    most_stuck = std::max<std::size_t>(most_stuck, result.tools[kIndex].nodes);
    for (const Contact& contact : result.contacts) EXPECT_GT(contact.force_n.dot(contact.normal), 0);
    for (const std::uint32_t node : hand.surface().nodes) {
      const Vector3 place_m = mesh_.nodes[node] + hand.displacement_m().segment<3>(first_row(node));
      const bool bound = std::ranges::count(result.bound, node, &BoundNode::node) > 0;
      for (const std::size_t tool : {kThumb, kIndex, kPlate}) {
        if (bound) continue;
        EXPECT_GT(distance_to(tools_[tool].shape, poses[tool]->to_tool(place_m)).distance_m, -1e-6 * size_m);
      }
    }
    // Pressed nodes lie on their tools, and loads in place of tools hold the body where it is.
    EXPECT_LT(result.largest_gap_m, 1e-6 * size_m);
  }
  const ManipulationResult& result = hand.result();
  EXPECT_GT(result.tools[kThumb].nodes, 0U);
  EXPECT_GT(result.tools[kPlate].nodes, 0U);
  EXPECT_GT(most_stuck, 0U);
  const Eigen::VectorXd load_n = weight_n_ + hand.tool_force_n();
  Eigen::VectorXd left_n = load_n - body_.inner_force_n(hand.displacement_m());
  for (Eigen::Index i = 0; i < left_n.size(); ++i) {
    if (!body_.linear().free()[static_cast<std::size_t>(i)]) left_n[i] = 0;
  }
  const double unbalanced = left_n.cwiseAbs().maxCoeff() / load_n.cwiseAbs().maxCoeff();
  record_corotational("unbalanced", unbalanced);
  EXPECT_LT(unbalanced, 1e-8);
  Vector3 sum_n = Vector3::Zero();
  for (const ToolForce& tool : result.tools) sum_n += tool.force_n;
  EXPECT_LT((sum_n - result.wrist_force_n).norm(), 1e-15);
}

TEST_F(CorotationalManipulationTest, SmallMotionsAreThoseOfALinearBody) {
  const ContactBody contact(body_.linear());
  Manipulation linear(contact, tools_);
  const Eigen::VectorXd none_n = Eigen::VectorXd::Zero(weight_n_.size());
  CorotationalManipulation hand(body_, none_n, tools_);
  linear.grasp(kForceps, turned(0, 0));
  hand.grasp(kForceps, turned(0, 0));
  std::vector<OptionalPose> poses(4);
  poses[kForceps] = turned(1e-5, 60);
  Pose thumb;
  thumb.position_m = {0.04, 0.02 / 3, 0.028 - 2e-7};
  poses[kThumb] = thumb;
  linear.step(poses);
  hand.step(poses);
  const Eigen::VectorXd expected_m = linear.displacement_m();
  EXPECT_LT((hand.displacement_m() - expected_m).norm(), 1e-3 * expected_m.norm());
  ASSERT_GT(linear.result().tools[kThumb].nodes, 0U);
  EXPECT_EQ(hand.result().tools[kThumb].nodes, linear.result().tools[kThumb].nodes);
  for (const std::size_t tool : {kForceps, kThumb}) {
    const Vector3 expected_n = linear.result().tools[tool].force_n;
    EXPECT_LT((hand.result().tools[tool].force_n - expected_n).norm(), 1e-3 * expected_n.norm());
  }
}

TEST_F(CorotationalManipulationTest, ATurningGraspUnderAFingerMovesNothing) {
  CorotationalManipulation hand(body_, weight_n_, tools_);
  std::vector<OptionalPose> poses(4);
  Pose thumb;
  thumb.position_m = {0.08, 0.02 / 3, 0.0255};
  poses[kThumb] = thumb;
  hand.step(poses);
  ASSERT_GT(hand.result().tools[kThumb].nodes, 0U);
  const Eigen::VectorXd before_m = hand.displacement_m();
  const Vector3 wrist_n = hand.result().wrist_force_n;
  Pose jaws;
  jaws.position_m = Vector3(0.08, 0.01, 0.01) + Vector3(before_m.tail<3>());
  hand.grasp(kForceps, jaws);
  poses[kForceps] = jaws;
  hand.step(poses);
  EXPECT_LT((hand.displacement_m() - before_m).norm(), 1e-7 * before_m.norm());
  EXPECT_LT((hand.result().wrist_force_n - wrist_n).norm(), 1e-6 * wrist_n.norm());
}

TEST_F(CorotationalManipulationTest, AFingerInWhatWasHeldPushesItOutOnceItIsReleased) {
  CorotationalManipulation hand(body_, Eigen::VectorXd::Zero(weight_n_.size()), tools_);
  std::vector<OptionalPose> poses(4);
  poses[kForceps] = turned(0, 0);
  hand.grasp(kForceps, *poses[kForceps]);
  // It meets nothing but held nodes, which bear no force.
  Pose thumb;
  thumb.position_m = {0.0865, 0.02 / 3, 0.02 / 3};
  poses[kThumb] = thumb;
  hand.step(poses);
  ASSERT_EQ(hand.result().tools[kThumb].nodes, 0U);
  hand.release(kForceps);  // opened, and still there
  hand.step(poses);
  EXPECT_GT(hand.result().tools[kThumb].nodes, 0U);
  for (const std::uint32_t node : hand.surface().nodes) {
    const Vector3 place_m = mesh_.nodes[node] + hand.displacement_m().segment<3>(first_row(node));
    EXPECT_GT(distance_to(tools_[kThumb].shape, thumb.to_tool(place_m)).distance_m, -1e-6 * 0.08);
  }
}

TEST_F(CorotationalManipulationTest, SameStepsSameBitsAndCopiesGoOnByThemselves) {
  CorotationalManipulation hand(body_, weight_n_, tools_);
  std::vector<OptionalPose> poses(4);
  Pose thumb;
  thumb.position_m = {0.05, 0.01, 0.022};
  poses[kThumb] = thumb;
  hand.step(poses);
  CorotationalManipulation copy(hand);
  poses[kThumb]->position_m.z() -= 0.004;
  hand.step(poses);
  const Eigen::VectorXd moved_m = hand.displacement_m();
  poses[kThumb]->position_m.z() += 0.004;
  hand.step(poses);
  EXPECT_NE(copy.displacement_m(), moved_m);
  poses[kThumb]->position_m.z() -= 0.004;
  copy.step(poses);
  EXPECT_EQ(copy.displacement_m(), moved_m);
  CorotationalManipulation again(body_, weight_n_, tools_);
  poses[kThumb]->position_m.z() += 0.004;
  again.step(poses);
  poses[kThumb]->position_m.z() -= 0.004;
  again.step(poses);
  EXPECT_EQ(again.displacement_m(), moved_m);
}

TEST_F(CorotationalManipulationTest, RefusesInWordsAndStaysAsItWas) {
  CorotationalManipulation hand(body_, weight_n_, tools_);
  const auto refused = [](auto what) -> std::string {
    try {
      what();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  Pose away;
  away.position_m = {0.2, 0, 0};
  EXPECT_THAT(refused([&] { hand.grasp(kForceps, away); }), HasSubstr("finds nothing to grasp"));
  EXPECT_THAT(refused([&] { hand.grasp(kThumb, away); }), HasSubstr("presses and cannot grasp"));
  EXPECT_THAT(refused([&] { hand.release(kForceps); }), HasSubstr("holds nothing"));
  EXPECT_THROW(hand.step(std::vector<OptionalPose>(1)), UsageError);
  Pose jaws = turned(0, 0);
  jaws.position_m.z() += hand.displacement_m().tail<3>().z();
  hand.grasp(kForceps, jaws);
  hand.step(std::vector<OptionalPose>{jaws, {}, {}, {}});
  EXPECT_THAT(refused([&] { hand.step(std::vector<OptionalPose>(4)); }), HasSubstr("has no pose"));
  const Eigen::VectorXd before_m = hand.displacement_m();
  // Through what holds it: every element between would be turned inside out.
  jaws.position_m.x() = -0.05;
  EXPECT_THAT(refused([&] {
                hand.step(std::vector<OptionalPose>{jaws, {}, {}, {}});
              }),
              HasSubstr("% of the motion"));
  EXPECT_EQ(hand.displacement_m(), before_m);
}

}  // namespace
}  // namespace kiroku::sim
