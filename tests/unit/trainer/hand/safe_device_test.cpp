#include "trainer/hand/safe_device.h"

#include <cmath>
#include <limits>
#include <optional>
#include <random>

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

constexpr double kPeriodOfTest = 1e-3;

/// A device as a test drives it, that keeps what it was given.
class ScriptedDevice : public sim::HapticDevice {
 public:
  [[nodiscard]] std::size_t tools() const override { return 2; }
  bool read(std::span<sim::Pose> poses) override {
    if (!speaks) return false;
    for (sim::Pose& pose : poses) pose = next;
    return true;
  }
  void write(std::span<const Vector3> forces_n) override {
    for (std::size_t tool = 0; tool < 2; ++tool) {
      EXPECT_LE(forces_n[tool].norm(), 10 + 1e-9);
      EXPECT_LE((forces_n[tool] - last_n[tool]).norm(), 0.4 + 1e-9) << "at step " << steps;
      last_n[tool] = forces_n[tool];
    }
    ++steps;
  }
  [[nodiscard]] bool has_wrist() const override { return wrist_now.has_value(); }
  [[nodiscard]] sim::Pose wrist() const override { return *wrist_now; }
  std::optional<sim::Pose> wrist_now;
  sim::Pose next;
  bool speaks = true;
  std::array<Vector3, 2> last_n{Vector3::Zero(), Vector3::Zero()};
  int steps = 0;
};

struct Setting {
  ScriptedDevice inner;
  SafeDevice safe{inner, kPeriodOfTest};
  std::vector<sim::Pose> poses = std::vector<sim::Pose>(2);
  bool step(const Vector3& force_n) {
    const bool read = safe.read(poses);
    safe.write(std::vector<Vector3>(2, force_n));
    return read;
  }
};

TEST(SafeDevice, PassesOnWhatAHandDoes) {
  Setting setting;
  for (int i = 0; i < 1000; ++i) {
    setting.inner.next.position_m.x() += 1e-3;  // 1 m/s
    EXPECT_TRUE(setting.step({0, 0, 3}));
    EXPECT_EQ(setting.poses[1].position_m, setting.inner.next.position_m);
  }
  EXPECT_EQ(setting.inner.last_n[0], Vector3(0, 0, 3));
  EXPECT_EQ(setting.safe.faults().jumps + setting.safe.faults().unsound, 0U);
}

TEST(SafeDevice, NumbersThatAreNoneEndForcesSmoothlyUntilTheyMakeSense) {
  Setting setting;
  for (int i = 0; i < 100; ++i) setting.step({0, 0, 8});
  EXPECT_EQ(setting.inner.last_n[0].z(), 8);
  const sim::Pose good = setting.inner.next;
  setting.inner.next.position_m.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(setting.step({0, 0, 8}));
  EXPECT_NEAR(setting.inner.last_n[0].z(), 7.6, 1e-12);  // the slope's step, not at once
  EXPECT_TRUE(setting.poses[0].position_m.allFinite());
  for (int i = 0; i < 100; ++i) setting.step({0, 0, 8});
  EXPECT_EQ(setting.inner.last_n[0], Vector3::Zero());
  EXPECT_EQ(setting.safe.faults().unsound, 101U);
  setting.inner.next = good;
  int waited = 0;
  while (!setting.step({0, 0, 8})) ++waited;
  EXPECT_NEAR(waited, 300, 2);
}

TEST(SafeDevice, AJumpEndsForcesSmoothly) {
  Setting setting;
  for (int i = 0; i < 100; ++i) setting.step({0, 5, 0});
  setting.inner.next.position_m.z() += 0.05;
  EXPECT_FALSE(setting.step({0, 9, 0}));
  EXPECT_EQ(setting.safe.faults().jumps, 1U);
  for (int i = 0; i < 50; ++i) setting.step({0, 9, 0});
  EXPECT_EQ(setting.inner.last_n[1], Vector3::Zero());
  setting.inner.speaks = false;  // what says nothing is not steady
  for (int i = 0; i < 1000; ++i) setting.step({0, 9, 0});
  EXPECT_FALSE(setting.safe.believes());
}

TEST(SafeDevice, WhatTurnsFasterThanAHandHasJumped) {
  const Eigen::Quaterniond slightly(Eigen::AngleAxisd(0.02, Vector3::UnitX())),
      far(Eigen::AngleAxisd(1.5, Vector3::UnitX()));
  for (const bool is_wrist : {false, true}) {
    Setting setting;
    if (is_wrist) setting.inner.wrist_now = sim::Pose();
    Eigen::Quaterniond& turned =
        is_wrist ? setting.inner.wrist_now->orientation : setting.inner.next.orientation;
    for (int i = 0; i < 100; ++i) {  // 20 rad/s
      turned = (turned * slightly).normalized();
      EXPECT_TRUE(setting.step({0, 5, 0})) << is_wrist;
    }
    turned = Eigen::Quaterniond(-turned.coeffs());  // the same
    EXPECT_TRUE(setting.step({0, 5, 0})) << is_wrist;
    turned = (turned * far).normalized();
    EXPECT_FALSE(setting.step({0, 5, 0})) << is_wrist;
    EXPECT_EQ(setting.safe.faults().jumps, 1U) << is_wrist;
    for (int i = 0; i < 50; ++i) setting.step({0, 5, 0});
    EXPECT_EQ(setting.inner.last_n[0], Vector3::Zero()) << is_wrist;
  }
}

TEST(SafeDevice, LimitsHoldWhateverIsAskedFor) {
  Setting setting;  // the device checks them at each step
  std::mt19937 random(1);
  const auto number = [&] { return 1e3 * (static_cast<double>(random()) / 2147483648.0 - 1); };
  for (int i = 0; i < 20000; ++i) {
    if (random() % 100 == 0) setting.inner.next.position_m.x() = number();
    Vector3 wanted_n(number(), number(), number());
    if (random() % 50 == 0) wanted_n.y() = std::numeric_limits<double>::infinity();
    if (random() % 50 == 0) wanted_n.x() = std::numeric_limits<double>::max();
    setting.step(wanted_n);
    if (!setting.inner.next.position_m.allFinite()) setting.inner.next.position_m.setZero();
  }
  EXPECT_GT(setting.safe.faults().unsound_forces, 20U);
  setting.inner.next = {};
  setting.safe.come_to_rest();
  EXPECT_EQ(setting.inner.last_n[0], Vector3::Zero());
}

TEST(SafeDevice, RefusesLimitsWithoutSense) {
  ScriptedDevice inner;
  EXPECT_THROW(SafeDevice(inner, 0), UsageError);
  EXPECT_THROW(SafeDevice(inner, 1e-3, {0, 400, 3, 0.3}), UsageError);
  EXPECT_THROW(SafeDevice(inner, 1e-3, {10, std::numeric_limits<double>::infinity(), 3, 0.3}), UsageError);
}

}  // namespace
}  // namespace kiroku::trainer
