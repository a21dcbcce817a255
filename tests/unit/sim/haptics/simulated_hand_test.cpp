#include "sim/haptics/simulated_hand.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

SimulatedHand::Path resting_at(const Vector3& place_m) {
  return [place_m](double) {
    Pose pose;
    pose.position_m = place_m;
    return pose;
  };
}

TEST(SimulatedHand, GivesWayToAForceAsItsSpringDoes) {
  SimulatedHand hand({resting_at({0, 0, 0.1}), resting_at({0, 0, 0})}, 1e-3);
  std::vector<Pose> poses(2);
  const std::vector<Vector3> forces_n{{0.3, 0, 0}, {0, 0, 0}};
  for (int i = 0; i < 2000; ++i) hand.write(forces_n);
  ASSERT_TRUE(hand.read(poses));
  EXPECT_NEAR(poses[0].position_m.x(), 0.3 / 300, 1e-9);
  EXPECT_EQ(poses[0].position_m.z(), 0.1);
  EXPECT_EQ(poses[1].position_m, Vector3::Zero());
}

TEST(SimulatedHand, FollowsItsPathAlike) {
  const SimulatedHand::Path path = [](double time_s) {
    Pose pose;
    pose.position_m = {0.01 * time_s, 0, 0};
    pose.orientation = Eigen::AngleAxisd(time_s, Vector3::UnitZ());
    return pose;
  };
  SimulatedHand one({path}, 1e-3), other({path}, 1e-3);
  std::vector<Pose> poses(1), others(1);
  const std::vector<Vector3> forces_n{Vector3::Zero()};
  for (int i = 0; i < 1000; ++i) {
    one.write(forces_n);
    other.write(forces_n);
  }
  one.read(poses);
  other.read(others);
  EXPECT_EQ(poses[0].position_m, others[0].position_m);
  // Behind it by what the damper asks for, d v / k, but for the way of a step.
  EXPECT_NEAR(poses[0].position_m.x(), 0.01 - 8 * 0.01 / 300, 0.01 * 1.001e-3);
  EXPECT_TRUE(poses[0].sound());
}

TEST(SimulatedHand, RefusesWhatWouldNotStayFinite) {
  EXPECT_THROW(SimulatedHand({resting_at({0, 0, 0})}, 0), UsageError);
  EXPECT_THROW(SimulatedHand({resting_at({0, 0, 0})}, 0.1), UsageError);
  EXPECT_THROW(SimulatedHand({resting_at({0, 0, 0})}, 1e-3, {-1, 300, 8}), UsageError);
}

}  // namespace
}  // namespace kiroku::sim
