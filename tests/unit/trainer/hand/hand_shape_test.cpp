#include "trainer/hand/hand_shape.h"

#include <gtest/gtest.h>

#include "tests/support/eventually.h"
#include "tests/unit/trainer/made_object.h"
#include "trainer/exclusion/hand_forces.h"
#include "trainer/exclusion/simulated_trainee.h"

namespace kiroku::trainer {
namespace {

using sim::Pose;
using sim::Vector3;

/// Fingertips side by side, held as the axes are; the hand's wrist at the origin.
std::vector<Pose> tips(std::size_t fingers, double ahead_m, double palmar_m) {
  std::vector<Pose> poses(fingers);
  for (std::size_t i = 0; i < fingers; ++i)
    poses[i].position_m = {
        HandShape::kKnucklesApartMetres * (static_cast<double>(i) - static_cast<double>(fingers - 1) / 2),
        ahead_m, palmar_m};
  return poses;
}

struct Ends {
  Vector3 back_m, front_m;
};
/// Of a capsule's axis; the front is where it was led to.
Ends ends_of(const sim::ContactTool& tool, const Pose& pose) {
  const double half_m = std::get<sim::Capsule>(tool.shape).half_length_m;
  return {pose.from_tool({0, 0, -half_m}), pose.from_tool({0, 0, half_m})};
}

TEST(HandShape, ABentFingerGoesFromItsKnuckleToItsTip) {
  const HandShape shape(1);
  std::vector<Pose> parts(shape.parts());
  const std::vector<Pose> fingertip = tips(1, 0.15, 0.02);
  shape.place({}, fingertip, parts);
  const std::vector<sim::ContactTool> tools = shape.tools(0);
  ASSERT_EQ(tools.size(), parts.size());
  const Ends distal = ends_of(tools[0], parts[0]), middle = ends_of(tools[1], parts[1]),
             proximal = ends_of(tools[2], parts[2]);
  EXPECT_LE((proximal.back_m - Vector3(0, HandShape::kKnuckleMetres, 0)).norm(), 1e-12);
  EXPECT_LE((proximal.front_m - middle.front_m).norm(), 1e-9);  // both lead to the joint between them
  EXPECT_LE((middle.back_m - distal.back_m).norm(), 1e-9);
  EXPECT_LE((distal.back_m - Vector3(0, 0.15 - HandShape::kDistalMetres, 0.02)).norm(), 1e-12);
  // Behind the fingertip, and bent away from the palm.
  EXPECT_LT(distal.front_m.y(), 0.15);
  const double straight_z = (proximal.back_m.z() + middle.back_m.z()) / 2;
  EXPECT_LT(proximal.front_m.z(), straight_z - 0.005);
  for (const Pose& part : parts) EXPECT_TRUE(part.sound());
}

TEST(HandShape, AFingerThatIsTooFarOffOrTooNearStaysAHandThatIsOne) {
  for (const std::size_t fingers : {1U, 3U, 5U}) {
    const HandShape shape(fingers);
    std::vector<Pose> parts(shape.parts());
    for (const double ahead_m : {-0.3, 0.0, 0.09 + HandShape::kDistalMetres, 0.1, 0.12, 0.17, 0.18, 0.5}) {
      shape.place({}, tips(fingers, ahead_m, 0), parts);
      for (const Pose& part : parts) EXPECT_TRUE(part.sound()) << ahead_m;
    }
    // Out of reach: straight from the knuckle.
    shape.place({}, tips(fingers, 0.5, 0), parts);
    const Ends proximal = ends_of(shape.tools(0)[2], parts[2]);
    EXPECT_NEAR(proximal.front_m.y(), HandShape::kKnuckleMetres + HandShape::kProximalMetres, 1e-9);
    EXPECT_NEAR(proximal.front_m.z(), 0, 1e-9);
  }
}

TEST(HandShape, TurnsAndMovesWithTheHand) {
  const HandShape shape(2);
  const Pose moved{{0.3, -0.2, 0.1},
                   Eigen::Quaterniond(Eigen::AngleAxisd(1.1, Vector3(1, 2, -1).normalized()))};
  const std::vector<Pose> before = tips(2, 0.14, 0.03);
  std::vector<Pose> after = before, parts(shape.parts()), moved_parts(shape.parts());
  for (Pose& tip : after) {
    tip.position_m = moved.from_tool(tip.position_m);
    tip.orientation = moved.orientation;
  }
  shape.place({}, before, parts);
  shape.place(moved, after, moved_parts);
  const std::vector<sim::ContactTool> tools = shape.tools(0);
  for (std::size_t part = 0; part < parts.size(); ++part) {
    const Ends was = ends_of(tools[part], parts[part]), is = ends_of(tools[part], moved_parts[part]);
    EXPECT_LE((moved.from_tool(was.back_m) - is.back_m).norm(), 1e-9) << tools[part].name;
    EXPECT_LE((moved.from_tool(was.front_m) - is.front_m).norm(), 1e-9) << tools[part].name;
  }
}

TEST(HandShape, AWristThatNobodyTellsIsBehindTheFingertips) {
  std::vector<Pose> fingertips = tips(3, 0.1, 0);
  const Pose wrist = HandShape::wrist_behind(fingertips);
  EXPECT_LE((wrist.position_m - Vector3(0, 0.1 - 0.173, 0)).norm(), 1e-3);
  EXPECT_LE(wrist.orientation.angularDistance(Eigen::Quaterniond::Identity()), 1e-9);
  for (Pose& tip : fingertips) tip.orientation = Eigen::AngleAxisd(0.5, Vector3::UnitX());
  EXPECT_LE(HandShape::wrist_behind(fingertips).orientation.angularDistance(fingertips[0].orientation), 1e-9);
}

TEST(HandForces, OfAWholeHandTheWristBearsWhatPhalangesAndPalmFeel) {
  const ExclusionBody body(made_object(ObjectKind::kLiver, 900), exclusion_task(ObjectKind::kLiver));
  HandForces fingers(body, 2, Feedback::kFull), hand(body, 2, Feedback::kFull, Touch::kHand);
  const double below_m = -half_thickness_m(ObjectKind::kLiver);
  std::vector<Pose> poses(2);
  std::vector<Vector3> played_n(2), alone_n(2);
  for (int step = 0; step <= 50; ++step) {
    const double lifted_m = 1.6e-4 * step;
    for (std::size_t i = 0; i < 2; ++i)
      poses[i].position_m = {i == 0 ? -0.03 : 0.03, 0.045, below_m - kFingertipMetres + lifted_m};
    hand.wrist_at(
        Pose{{0, -0.11, below_m - HandShape::kPalmRadiusMetres + lifted_m}, Eigen::Quaterniond::Identity()});
    for (HandForces* const each : {&fingers, &hand}) {
      ASSERT_TRUE(test::eventually([&] {
        each->forces(poses, 1e-3, each == &hand ? played_n : alone_n);
        const sim::HapticContact::Deformation found = each->refresh();
        return found.nodes_known > 0 && found.nodes_awaited == 0;
      }));
    }
  }
  for (int step = 0; step < 60; ++step) hand.forces(poses, 1e-3, played_n);
  const HandForces::State state = hand.state();
  ASSERT_EQ(state.parts_n.size(), HandShape(2).parts());
  Vector3 sum_n = Vector3::Zero(), palm_n = Vector3::Zero();
  for (std::size_t i = 0; i < 2; ++i) {
    sum_n += state.forces_n[i];
    EXPECT_EQ(played_n[i], state.forces_n[i]);
  }
  for (std::size_t part = 0; part < state.parts_n.size(); ++part) {
    sum_n += state.parts_n[part];
    if (part >= 2 * HandShape::kPhalanges) palm_n += state.parts_n[part];
  }
  EXPECT_LE((state.wrist_n - sum_n).norm(), 1e-12);
  EXPECT_LE((hand.wrist_force({0, -0.11, 0}).force_n - sum_n).norm(), 1e-12);
  EXPECT_GT(palm_n.norm(), 0.05);
  // The palm bears what the fingertips would have to bear alone.
  EXPECT_GT(state.wrist_n.norm(), (alone_n[0] + alone_n[1]).norm());
  EXPECT_TRUE(fingers.state().parts_n.empty());
}

/// As of a program at a UDP device that is restarted and speaks of no wrist any more.
TEST(HandForces, AWristThatGoesAwayIsTakenToBeBehindTheFingertipsAgain) {
  const ExclusionBody body(made_object(ObjectKind::kLiver, 900), exclusion_task(ObjectKind::kLiver));
  HandForces hand(body, 2, Feedback::kFull, Touch::kHand);
  const std::vector<Pose> poses = tips(2, 0.2, -0.3);
  std::vector<Vector3> played_n(2);
  hand.forces(poses, 1e-3, played_n);
  const std::vector<Pose> behind = hand.state().parts;
  hand.wrist_at(Pose{{0.1, 0, -0.3}, Eigen::Quaterniond::Identity()});
  hand.forces(poses, 1e-3, played_n);
  (void)hand.wrist_force({0.1, 0, -0.3});
  EXPECT_GT((hand.state().parts.back().position_m - behind.back().position_m).norm(), 0.05);
  EXPECT_TRUE(hand.state().wrist_torque_nm);
  hand.wrist_at(std::nullopt);
  hand.forces(poses, 1e-3, played_n);
  EXPECT_EQ(hand.state().parts.back().position_m, behind.back().position_m);
  EXPECT_FALSE(hand.state().wrist_torque_nm);
}

/// A patient's organ may be lifted another way than objects A and B are.
TEST(SimulatedTrainee, ItsWholeHandComesFromWhereItsOwnerStands) {
  for (const sim::Vector3& lifts : {Vector3(0, 0, 1), Vector3(0, -1, 0)}) {
    // From the front, and from the feet, lifted towards the front.
    ExclusionTask task = exclusion_task(ObjectKind::kLiver);
    const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), lifts);  // about x
    task.lifts = lifts;
    task.under_border_m = turn * task.under_border_m;
    OrganObject object = made_object(ObjectKind::kLiver, 900);
    for (Vector3& node : object.mesh.nodes) node = turn * node;
    const ExclusionBody body(std::move(object), task);
    LiftPlan plan;
    plan.offset_m = {0, 0, 0};
    SimulatedTrainee trainee(body, plan, 2e-3);
    std::vector<Pose> poses(3), parts(HandShape(3).parts());
    ASSERT_TRUE(trainee.read(poses));
    const Pose wrist = HandShape::wrist_behind(poses);
    EXPECT_LT((wrist.orientation * Vector3::UnitY() - task.away()).norm(), 1e-9);
    EXPECT_LT((wrist.orientation * Vector3::UnitZ() - task.lifts).norm(), 1e-9);
    EXPECT_LT(task.away().dot(wrist.position_m - task.under_border_m), -0.15);
    // Nothing of the hand touches before it lifts.
    HandForces hand(body, 3, Feedback::kFull, Touch::kHand);
    std::vector<Vector3> forces_n(3);
    for (int i = 0; i < 5; ++i) {
      (void)hand.refresh();
      hand.forces(poses, 2e-3, forces_n);
    }
    EXPECT_EQ(hand.state().wrist_n, Vector3::Zero());
    // The part that tangential feedback plays is the one that lifts.
    EXPECT_LT((played_n(Feedback::kTangential, poses[0], lifts) - lifts).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace kiroku::trainer
