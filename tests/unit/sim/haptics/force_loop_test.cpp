#include "sim/haptics/force_loop.h"

#include <atomic>
#include <chrono>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/haptics/haptic_contact.h"
#include "sim/haptics/simulated_hand.h"
#include "tests/support/eventually.h"
#include "tests/support/tet_cylinder.h"

namespace kiroku::sim {
namespace {

using namespace std::chrono_literals;

void wait_for(const std::function<bool()>& condition) { ASSERT_TRUE(test::eventually(condition)); }

class StillDevice : public HapticDevice {
 public:
  [[nodiscard]] std::size_t tools() const override { return 2; }
  bool read(std::span<Pose>) override { return present; }
  void write(std::span<const Vector3> forces_n) override {
    last_n = forces_n[0].norm();
    ++written;
  }
  std::atomic<bool> present = true;
  std::atomic<double> last_n = 0;
  std::atomic<int> written = 0;
};

class ConstantForce : public ForceSource {
 public:
  void forces(std::span<const Pose>, double, std::span<Vector3> forces_n) override {
    if (fails) throw Error("the source failed");
    for (Vector3& out_n : forces_n) out_n = {force_n, 0, 0};
  }
  std::atomic<double> force_n = 1;
  std::atomic<bool> fails = false;
};

TEST(ForceLoop, WritesForcesAndCountsItsSteps) {
  StillDevice device;
  ConstantForce source;
  ForceLoop loop(device, source, {1000, 0});
  wait_for([&] { return loop.statistics().steps >= 50; });
  EXPECT_EQ(device.last_n, 1);
  loop.stop();
  EXPECT_FALSE(loop.running());
  const ForceLoopStatistics statistics = loop.statistics();
  EXPECT_EQ(device.written, static_cast<int>(statistics.steps) + 1);
  EXPECT_EQ(device.last_n, 0);  // nobody is left with a force
  EXPECT_LE(statistics.on_time, statistics.steps);
  EXPECT_LE(statistics.on_time_share(), 1);
  EXPECT_GE(statistics.jitter_longest, statistics.jitter_999);
  EXPECT_GE(statistics.jitter_999, statistics.jitter_50);
  EXPECT_GE(statistics.step_longest, statistics.step_50);
  EXPECT_FALSE(statistics.real_time);
}

/// A hand whose wrist is there, and what its loop gave it.
class DeviceWithWrist : public StillDevice {
 public:
  [[nodiscard]] bool has_wrist() const override { return true; }
  [[nodiscard]] Pose wrist() const override { return {{0, 0.5, 0}, Eigen::Quaterniond::Identity()}; }
  void write_wrist(const WristForce& wrist) override {
    wrist_n = wrist.force_n.norm();
    wrist_nm = wrist.torque_nm.norm();
  }
  std::atomic<double> wrist_n = -1, wrist_nm = -1;
};

/// What a wrist bears of it is 3 N, and as many N m as it is far from the origin, times `times`.
class ForceAtTheWrist : public ConstantForce {
 public:
  WristForce wrist_force(const Vector3& wrist_m) override {
    return {Vector3(0, 3 * times, 0), Vector3(0, 0, times * wrist_m.norm())};
  }
  std::atomic<double> times = 1;
};

TEST(ForceLoop, GivesTheWristWhatItBearsWithinItsLimits) {
  DeviceWithWrist device;
  ForceAtTheWrist source;
  ForceLoopOptions options{1000, 0};
  options.most_wrist_n = 50;
  options.most_wrist_nm = 4;
  options.pose_timeout = 5ms;
  ForceLoop loop(device, source, options);
  wait_for([&] { return device.wrist_n == 3 && device.wrist_nm == 0.5; });
  EXPECT_EQ(loop.statistics().limited_forces, 0U);
  source.times = 100;
  wait_for([&] { return std::abs(device.wrist_n - 50) < 1e-9 && std::abs(device.wrist_nm - 4) < 1e-12; });
  EXPECT_EQ(device.last_n, 1);  // fingers have their own
  source.times = std::nan("");
  wait_for([&] { return device.wrist_n == 0 && device.wrist_nm == 0; });
  source.times = 1;
  wait_for([&] { return device.wrist_n == 3; });
  device.present = false;  // without poses nothing is felt
  wait_for([&] { return device.wrist_n == 0; });
  device.present = true;
  wait_for([&] { return device.wrist_n == 3; });
  loop.stop();
  EXPECT_EQ(device.wrist_n, 0);
  EXPECT_EQ(device.wrist_nm, 0);
}

TEST(WristForce, IsTheSumOfForcesAndTheirTorqueAboutTheWrist) {
  std::vector<Pose> poses(2);
  poses[0].position_m = {1, 0, 0};
  poses[1].position_m = {0, 0, 2};
  const std::vector<Vector3> forces_n{{0, 5, 0}, {-3, 0, 0}}, torques_nm{{0, 0, 0.25}, {0.5, 0, 0}};
  const WristForce wrist = wrist_force_of({0, 0, 1}, poses, forces_n, torques_nm);
  EXPECT_EQ(wrist.force_n, Vector3(-3, 5, 0));
  // (1, 0, -1) x (0, 5, 0) = (5, 0, 5); (0, 0, 1) x (-3, 0, 0) = (0, -3, 0).
  EXPECT_EQ(wrist.torque_nm, Vector3(5.5, -3, 5.25));
}

TEST(ForceLoop, LimitsForcesAndLetsNothingElseThanNumbersOut) {
  StillDevice device;
  ConstantForce source;
  source.force_n = 1e6;
  ForceLoop loop(device, source, {1000, 0, 5});
  wait_for([&] { return device.last_n != 0; });
  EXPECT_NEAR(device.last_n, 5, 1e-12);
  source.force_n = std::nan("");
  wait_for([&] { return device.last_n == 0; });
  EXPECT_GT(loop.statistics().limited_forces, 0U);
}

TEST(ForceLoop, WithoutPosesNothingIsFelt) {
  StillDevice device;
  device.present = false;
  ConstantForce source;
  ForceLoopOptions options{1000, 0};
  options.pose_timeout = 5ms;
  ForceLoop loop(device, source, options);
  wait_for([&] { return loop.statistics().without_pose >= 3; });
  EXPECT_EQ(device.last_n, 0);
  device.present = true;
  wait_for([&] { return device.last_n == 1; });
  device.present = false;
  wait_for([&] { return device.last_n == 0; });
}

TEST(ForceLoop, AFailureEndsItAndIsTold) {
  StillDevice device;
  ConstantForce source;
  ForceLoop loop(device, source, {1000, 0});
  wait_for([&] { return device.last_n == 1; });
  source.fails = true;
  wait_for([&] { return !loop.running(); });
  EXPECT_EQ(device.last_n, 0);
  EXPECT_THROW((void)loop.statistics(), Error);
  EXPECT_THROW(loop.stop(), Error);
}

TEST(ForceLoop, RefusesOptionsWithoutSense) {
  StillDevice device;
  ConstantForce source;
  EXPECT_THROW(ForceLoop(device, source, {0}), UsageError);
  EXPECT_THROW(ForceLoop(device, source, {1000, 100}), UsageError);
  EXPECT_THROW(ForceLoop(device, source, {1000, 0, 0}), UsageError);
}

TEST(LatencyHistogram, PercentilesAreAtMostASixteenthAbove) {
  LatencyHistogram histogram;
  EXPECT_EQ(histogram.percentile(0.5), 0ns);
  for (int i = 1; i <= 100000; ++i) histogram.add(std::chrono::nanoseconds(i));
  for (const double share : {0.01, 0.5, 0.99, 0.999}) {
    const double exact = share * 100000;
    const auto found = static_cast<double>(histogram.percentile(share).count());
    EXPECT_GE(found, exact - 1) << share;
    EXPECT_LE(found, 1.0625 * exact + 1) << share;
  }
  EXPECT_EQ(histogram.percentile(1), 100000ns);
  histogram.add(-5ns);  // a clock that is not exact
  histogram.add(std::chrono::nanoseconds::max());
  EXPECT_EQ(histogram.longest(), std::chrono::nanoseconds::max());
  EXPECT_EQ(histogram.percentile(1), std::chrono::nanoseconds::max());
}

class HapticContactTest : public testing::Test {
 protected:
  static ElasticBody held_cylinder() {
    TetMesh mesh = test::tet_cylinder(5, 10, 0.03, 0.1);
    Constraints constraints(mesh.nodes.size());
    for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
      if (mesh.nodes[node].z() == 0) constraints.prescribe(node, Vector3::Zero(), "test");
    }
    return {std::move(mesh), {{0, {1e4, 0.4}}}, constraints};
  }
  /// Two fingers that press from both sides, stroke along the body and come back in `time_s`.
  static std::vector<Pose> hand(double time_s) {
    const double turn = 2 * 3.14159265358979 * time_s, from_axis_m = 0.0385 - 0.002 * std::sin(turn);
    std::vector<Pose> poses(2);
    poses[0].position_m = {from_axis_m, 0.003 * std::sin(2 * turn), 0.06 + 0.02 * std::sin(turn)};
    poses[1].position_m = {-from_axis_m, 0, 0.06 + 0.02 * std::sin(turn)};
    return poses;
  }

  ElasticBody body_ = held_cylinder();
  std::vector<ContactTool> tools_{{"thumb", Sphere{0.01}, false}, {"finger", Sphere{0.01}, false}};
};

TEST_F(HapticContactTest, ForcesAreThoseOfTheWholeSurfaceAndContinuous) {
  const ContactBody whole(body_);
  ContactSolver exact(whole.whole_surface(), tools_);
  const ContactBody part(body_, {}, {1, std::size_t{12} << 20});  // columns come when asked for
  ASSERT_FALSE(part.compliance().complete());
  HapticContact contact(part, tools_);
  std::vector<Vector3> forces_n(2), last_n(2, Vector3::Zero());
  // Nothing is known yet; then the deformation loop finds out, and what is there already comes in slowly.
  contact.forces(hand(0), 1e-3, forces_n);
  EXPECT_EQ(forces_n[0], Vector3::Zero());
  wait_for([&] {
    contact.forces(hand(0), 1e-3, forces_n);
    const HapticContact::Deformation found = contact.refresh();
    return found.nodes_known > 0 && found.nodes_awaited == 0;
  });
  contact.forces(hand(0), 1e-3, forces_n);
  for (int i = 0; i < 100; ++i) {
    contact.forces(hand(0), 1e-3, forces_n);
    if (i == 50) (void)contact.refresh();
  }
  last_n = forces_n;
  int different = 0;
  double largest_jump_n = 0, largest_exact_jump_n = 0, largest_n = 0;
  Vector3 exact_last_n = exact.step(hand(0)).tools[0].force_n;
  for (int step = 1; step <= 1000; ++step) {
    const std::vector<Pose> poses = hand(step * 1e-3);
    contact.forces(poses, 1e-3, forces_n);
    if (step % 30 == 0) {
      // The worker may take longer than this hand, which does not wait between its steps.
      HapticContact::Deformation found;
      wait_for([&] { return (found = contact.refresh()).nodes_awaited == 0; });
      EXPECT_EQ(found.steps_failed, 0U);
      EXPECT_EQ(found.displacement_m.size(), static_cast<Eigen::Index>(3 * body_.mesh().nodes.size()));
    }
    const Vector3 exact_n = exact.step(poses).tools[0].force_n;
    largest_n = std::max(largest_n, exact_n.norm());
    largest_jump_n = std::max(largest_jump_n, (forces_n[0] - last_n[0]).norm());
    largest_exact_jump_n = std::max(largest_exact_jump_n, (exact_n - exact_last_n).norm());
    if ((forces_n[0] - exact_n).norm() > 0.01 * largest_n) ++different;
    last_n = forces_n;
    exact_last_n = exact_n;
  }
  EXPECT_GT(largest_n, 0.05);
  // Where a node slides off a finger, the loop's few iterations come to rest some steps later.
  EXPECT_LE(different, 10);
  // No change of neighbourhood is felt: forces change as the hand's motion makes them change.
  EXPECT_LE(largest_jump_n, 1.5 * largest_exact_jump_n);
}

/// Eq. 6 against the sum over all nodes that are touched: forces where they act, not where tools are.
TEST_F(HapticContactTest, TheWristBearsTheForcesOfAllNodes) {
  for (const double friction : {0.0, 0.5}) {
    std::vector<ContactTool> tools = tools_;
    tools[1].shape = Capsule{0.01, 0.03};  // touched along its length, away from its middle
    for (ContactTool& tool : tools) {
      tool.sticks = friction > 0;
      if (tool.sticks) tool.friction = friction;
    }
    const ContactBody whole(body_);
    ASSERT_TRUE(whole.compliance().complete());
    HapticContact contact(whole, tools);
    std::vector<Vector3> forces_n(2);
    for (int step = 0; step <= 250; ++step) contact.forces(hand(step * 1e-3), 1e-3, forces_n);
    const Vector3 wrist_m(0.1, -0.2, 0.05);
    const WristForce wrist = contact.wrist_force(wrist_m);
    const HapticContact::Deformation found = contact.refresh();
    Vector3 sum_n = Vector3::Zero(), sum_nm = Vector3::Zero();
    double all_nm = 0;
    for (const Contact& touched : found.contacts) {
      const auto node = static_cast<Eigen::Index>(3 * std::size_t{touched.node});
      const Vector3 at_m = body_.mesh().nodes[touched.node] + found.displacement_m.segment<3>(node);
      sum_n -= touched.force_n;
      sum_nm -= (at_m - wrist_m).cross(touched.force_n);
      all_nm += (at_m - wrist_m).norm() * touched.force_n.norm();
    }
    ASSERT_GT(found.contacts.size(), 2U);
    EXPECT_LE((wrist.force_n - forces_n[0] - forces_n[1]).norm(), 1e-12);
    EXPECT_LE((wrist.force_n - sum_n).norm(), 1e-12);
    EXPECT_LE((wrist.torque_nm - sum_nm).norm(), 1e-6 * all_nm) << "friction " << friction;
    EXPECT_GT(wrist.torque_nm.norm(), 1e-4);
  }
}

TEST_F(HapticContactTest, WhatTurnsUpInsideAToolIsFadedIn) {
  const ContactBody part(body_, {}, {1, std::size_t{12} << 20});
  HapticContact contact(part, tools_);
  std::vector<Vector3> forces_n(2);
  const std::vector<Pose> poses = hand(0.25);
  wait_for([&] {
    contact.forces(poses, 1e-9, forces_n);  // hardly any time passes for the fading
    const HapticContact::Deformation found = contact.refresh();
    return found.nodes_known > 0 && found.nodes_awaited == 0;
  });
  std::vector<double> sizes_n;
  for (int i = 0; i < 60; ++i) {
    contact.forces(poses, 1e-3, forces_n);
    sizes_n.push_back(forces_n[0].norm());
  }
  EXPECT_GT(sizes_n.back(), 0.05);
  for (std::size_t i = 1; i < sizes_n.size(); ++i)
    EXPECT_LE(std::abs(sizes_n[i] - sizes_n[i - 1]), 0.12 * sizes_n.back()) << i;
  EXPECT_NEAR(sizes_n[58], sizes_n[59], 1e-6 * sizes_n[59]);
}

TEST_F(HapticContactTest, ToolsThatOverlapRepeatTheForcesBefore) {
  const ContactBody whole(body_);
  ASSERT_TRUE(whole.compliance().complete());
  HapticContact contact(whole,
                        {{"upper", Box{{0.1, 0.1, 0.01}}, false}, {"lower", Box{{0.1, 0.1, 0.01}}, false}});
  std::vector<Pose> poses(2);
  std::vector<Vector3> forces_n(2);
  poses[0].position_m = {0, 0, 0.109};
  poses[1].position_m = {0, 0, 0.2};
  contact.forces(poses, 1e-3, forces_n);
  const Vector3 before_n = forces_n[0];
  EXPECT_GT(before_n.z(), 0);
  poses[1].position_m.z() = 0.0905;
  contact.forces(poses, 1e-3, forces_n);
  EXPECT_EQ(forces_n[0], before_n);
  poses[1].position_m.z() = 0.2;
  contact.forces(poses, 1e-3, forces_n);
  EXPECT_LE((forces_n[0] - before_n).norm(), 1e-9 * before_n.norm());
  EXPECT_EQ(contact.refresh().steps_failed, 1U);
  EXPECT_THROW(contact.forces(std::span(poses).first(1), 1e-3, forces_n), UsageError);
}

// Both threads on the real thing; the thread sanitizer watches.
TEST_F(HapticContactTest, TheForceLoopRunsBesideTheDeformationLoop) {
  const ContactBody part(body_, {}, {1, std::size_t{12} << 20});
  HapticContact contact(part, tools_);
  const auto finger = [](std::size_t tool) { return [tool](double time_s) { return hand(time_s)[tool]; }; };
  SimulatedHand device({finger(0), finger(1)}, 1e-3);
  ForceLoop loop(device, contact, {1000, 0});
  double largest_m = 0;
  wait_for([&] {
    const HapticContact::Deformation found = contact.refresh();
    EXPECT_TRUE(found.displacement_m.allFinite());
    largest_m = std::max(largest_m, found.displacement_m.lpNorm<Eigen::Infinity>());
    return loop.statistics().steps >= 500 && largest_m > 1e-3;
  });
  loop.stop();
  EXPECT_EQ(loop.statistics().without_pose, 0U);
}

}  // namespace
}  // namespace kiroku::sim
