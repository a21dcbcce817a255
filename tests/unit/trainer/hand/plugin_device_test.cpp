#include "sim/haptics/plugin_device.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/build_paths.h"
#include "tests/support/temporary_folder.h"
#include "trainer/hand/safe_device.h"

namespace kiroku::trainer {
namespace {

using sim::PluginDevice;
using sim::Vector3;
using testing::HasSubstr;

constexpr double kPluginPeriod = 1e-3;

std::filesystem::path plugin(const std::string& name) {
  return std::filesystem::path(test::built_file("lifting_finger")).replace_filename(name + ".so");
}

std::string refusal(const std::filesystem::path& library, const std::string& argument = "") {
  try {
    PluginDevice device(2, library, argument);
  } catch (const Error& error) {
    return error.what();
  }
  return "not refused";
}

TEST(PluginDevice, TheExampleLiftsItsFingers) {
  PluginDevice device(3, plugin("lifting_finger"), "0.02");
  std::vector<sim::Pose> poses(3);
  ASSERT_TRUE(device.read(poses));
  const double begin_m = poses[1].position_m.z();
  for (int step = 0; step < 3000; ++step) ASSERT_TRUE(device.read(poses));
  device.write(std::vector<Vector3>(3, Vector3(1, 2, 3)));
  EXPECT_NEAR(poses[1].position_m.z() - begin_m, 0.02, 1e-4);
  EXPECT_NEAR(poses[2].position_m.x() - poses[0].position_m.x(), 0.08, 1e-12);
  EXPECT_TRUE(poses[0].sound());
  EXPECT_FALSE(device.lost());
}

TEST(PluginDevice, OfVersionOneHasNoWristAndWorksAsBefore) {
  PluginDevice device(2, plugin("faulty_plugin"), "");
  EXPECT_FALSE(device.has_wrist());
  std::vector<sim::Pose> poses(2);
  device.write_wrist({{1, 2, 3}, {4, 5, 6}});  // nobody to play it
  device.write(std::vector<Vector3>(2, Vector3(1, 2, 3)));
  ASSERT_TRUE(device.read(poses));
  EXPECT_EQ(poses[1].position_m, Vector3(0.01, 0, -0.05));
  EXPECT_FALSE(device.lost());
}

/// A library of both versions is used by its second one.
TEST(PluginDevice, OfVersionTwoGivesItsWristAndIsGivenWhatItBears) {
  for (const char* const name : {"faulty_wrist_plugin", "both_versions_plugin"}) {
    PluginDevice device(2, plugin(name), "echo");
    ASSERT_TRUE(device.has_wrist()) << name;
    std::vector<sim::Pose> poses(2);
    device.write_wrist({{1, 2, 3}, {4, 5, 6}});
    device.write(std::vector<Vector3>{{7, 8, 9}, {0, 0, 0}});
    ASSERT_TRUE(device.read(poses));
    EXPECT_EQ(poses[0].position_m, Vector3(1, 2, 3));
    EXPECT_EQ(poses[1].position_m, Vector3(4, 5, 6));
    EXPECT_EQ(device.wrist().position_m, Vector3(7, 8, 9));
    EXPECT_TRUE(device.wrist().sound());
  }
}

TEST(PluginDevice, TheExampleWithAWristStopsWhereItBearsEnough) {
  PluginDevice device(3, plugin("lifting_hand"), "0.02:3");
  std::vector<sim::Pose> poses(3);
  const auto lifted_m = [&](double borne_n) {
    device.write_wrist({{0, 0, -borne_n}, Vector3::Zero()});
    device.write(std::vector<Vector3>(3, Vector3::Zero()));
    EXPECT_TRUE(device.read(poses));
    return poses[1].position_m.z();
  };
  const double begin_m = lifted_m(0);
  for (int step = 0; step < 500; ++step) (void)lifted_m(2.9);
  const double stopped_m = lifted_m(3.1);
  EXPECT_NEAR(stopped_m - begin_m, 0.005, 1e-9);
  for (int step = 0; step < 500; ++step) EXPECT_EQ(lifted_m(3.1), stopped_m);
  EXPECT_GT(lifted_m(2.9), stopped_m);
  EXPECT_NEAR(device.wrist().position_m.z() - poses[1].position_m.z(), -0.05 + 0.027, 1e-12);
}

TEST(PluginDevice, RefusesInWordsWhatIsNoPlugin) {
  const test::TemporaryFolder folder;
  EXPECT_THAT(refusal(folder / "absent.so"), HasSubstr("cannot be loaded"));
  std::ofstream(folder / "words.so") << "no library";
  EXPECT_THAT(refusal(folder / "words.so"), HasSubstr("cannot be loaded"));
  EXPECT_THAT(refusal(plugin("no_symbol_plugin")),
              HasSubstr("exports neither kiroku_haptic_plugin_2 nor kiroku_haptic_plugin"));
  EXPECT_THAT(refusal(plugin("other_abi_plugin")),
              HasSubstr("made for ABI 77, and kiroku_haptic_plugin is for ABI 1"));
  EXPECT_THAT(refusal(plugin("other_abi_wrist_plugin")),
              HasSubstr("made for ABI 77, and kiroku_haptic_plugin_2 is for ABI 2"));
  EXPECT_THAT(refusal(plugin("no_write_plugin")), HasSubstr("has a table with a function missing"));
  EXPECT_THAT(refusal(plugin("faulty_wrist_plugin"), "refuse"),
              HasSubstr("cannot open its device: nothing is plugged in"));
  EXPECT_THAT(refusal(plugin("lifting_hand"), "0.02"), HasSubstr("'0.02' is no height and force"));
  EXPECT_THAT(refusal(plugin("faulty_plugin"), "refuse"),
              HasSubstr("cannot open its device: nothing is plugged in"));
  EXPECT_THAT(refusal(plugin("lifting_finger"), "high"), HasSubstr("'high' is no height"));
  EXPECT_THROW(PluginDevice(0, plugin("faulty_plugin"), ""), UsageError);
}

/// However a plug-in fails, its forces go to zero within the slope and stay there.
class FailingPlugin : public testing::TestWithParam<const char*> {};

TEST_P(FailingPlugin, LeavesNoForceOnAFinger) {
  PluginDevice device(2, plugin("faulty_plugin"), GetParam());
  const SafetyLimits limits;
  SafeDevice safe(device, kPluginPeriod, limits);
  std::vector<sim::Pose> poses(2);
  std::vector<Vector3> before_n = safe.given_n();
  double largest_n = 0;
  int read = 0;
  for (int step = 0; step < 400; ++step) {
    const bool came = safe.read(poses);
    read += came ? 1 : 0;
    for (const sim::Pose& pose : poses) EXPECT_TRUE(pose.position_m.allFinite());
    // As a force loop does: nothing is felt without poses.
    safe.write(std::vector<Vector3>(2, came ? Vector3(0, 0, 50) : Vector3::Zero()));
    for (std::size_t tool = 0; tool < 2; ++tool) {
      EXPECT_LE((safe.given_n()[tool] - before_n[tool]).norm(),
                limits.most_slope_n_s * kPluginPeriod * (1 + 1e-12));
      EXPECT_LE(safe.given_n()[tool].norm(), limits.most_force_n * (1 + 1e-12));
      largest_n = std::max(largest_n, safe.given_n()[tool].norm());
    }
    before_n = safe.given_n();
  }
  EXPECT_EQ(before_n[0].norm(), 0);
  const std::string fault = GetParam();
  const bool goes = fault == "throw" || fault == "lose";
  EXPECT_EQ(device.lost(), goes);
  if (goes) {
    EXPECT_EQ(read, 100);
    EXPECT_THAT(device.why_lost(),
                HasSubstr(fault == "throw" ? "let an exception out" : "its device is lost"));
  }
  if (fault == "jump") {
    EXPECT_GT(safe.faults().jumps, 100U);
  } else {
    EXPECT_NEAR(largest_n, limits.most_force_n, 1e-9);
  }
}

/// The same for the wrist, which fingers that make sense do not excuse.
class FailingWrist : public testing::TestWithParam<const char*> {};

TEST_P(FailingWrist, LeavesNoForceOnFingersOrWrist) {
  PluginDevice device(2, plugin("faulty_wrist_plugin"), GetParam());
  const SafetyLimits limits;
  SafeDevice safe(device, kPluginPeriod, limits);
  std::vector<sim::Pose> poses(2);
  sim::WristForce before;
  double largest_n = 0, largest_nm = 0;
  for (int step = 0; step < 400; ++step) {
    const bool came = safe.read(poses);
    if (came) {
      EXPECT_TRUE(safe.wrist().sound());
    }
    const Vector3 wanted = came ? Vector3(0, 0, 50) : Vector3::Zero();
    safe.write_wrist({wanted, wanted});
    safe.write(std::vector<Vector3>(2, wanted));
    EXPECT_LE((safe.given_wrist().force_n - before.force_n).norm(),
              limits.most_wrist_slope_n_s * kPluginPeriod * (1 + 1e-12));
    EXPECT_LE((safe.given_wrist().torque_nm - before.torque_nm).norm(),
              limits.most_wrist_slope_nm_s * kPluginPeriod * (1 + 1e-12));
    before = safe.given_wrist();
    largest_n = std::max(largest_n, before.force_n.norm());
    largest_nm = std::max(largest_nm, before.torque_nm.norm());
  }
  EXPECT_NEAR(largest_n, limits.most_wrist_n, 1e-9);
  EXPECT_NEAR(largest_nm, limits.most_wrist_nm, 1e-9);
  EXPECT_EQ(before.force_n.norm(), 0);
  EXPECT_EQ(before.torque_nm.norm(), 0);
  EXPECT_EQ(safe.given_n()[0].norm(), 0);
  const std::string fault = GetParam();
  EXPECT_EQ(safe.faults().unsound > 200, fault == "nan" || fault == "nan wrist");
  EXPECT_EQ(safe.faults().jumps > 200, fault == "jump wrist");
}

INSTANTIATE_TEST_SUITE_P(Faults, FailingWrist,
                         testing::Values("nan", "nan wrist", "jump wrist", "throw", "lose"),
                         [](const auto& tested) {
                           std::string name = tested.param;
                           std::ranges::replace(name, ' ', '_');
                           return name;
                         });

INSTANTIATE_TEST_SUITE_P(Faults, FailingPlugin, testing::Values("nan", "jump", "throw", "lose"),
                         [](const auto& tested) { return std::string(tested.param); });

}  // namespace
}  // namespace kiroku::trainer
