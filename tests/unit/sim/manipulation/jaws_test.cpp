// What lies between two jaws, and what only touches them.
#include "sim/manipulation/jaws.h"

#include <gtest/gtest.h>

namespace kiroku::sim {
namespace {

TEST(Jaws, HaveBetweenThemWhatTheirFacesPress) {
  const Pose tool{{0.01, 0.02, 0.03}, Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Vector3::UnitX()))};
  const auto poses = jaw_poses(tool, {0.008, 0.004, 0.002}, 0.01);
  constexpr std::uint32_t kFirst = 3;
  const auto between = [&](std::uint32_t jaw, const Vector3& normal_in_tool) {
    Contact contact;
    contact.tool = jaw;
    contact.normal = tool.orientation * normal_in_tool;
    return between_jaws(contact, kFirst, poses);
  };
  const Vector3 up = Vector3::UnitZ(), beside_an_edge = Vector3(0.6, 0, 0.8);
  // The first is on the side of the tool's positive z, and looks down.
  EXPECT_TRUE(between(kFirst, -up));
  EXPECT_TRUE(between(kFirst, -beside_an_edge));
  EXPECT_TRUE(between(kFirst + 1, up));
  EXPECT_FALSE(between(kFirst, up)) << "at its back";
  EXPECT_FALSE(between(kFirst + 1, -up)) << "at its back";
  EXPECT_FALSE(between(kFirst, Vector3::UnitY())) << "at its side";
  // Tools before and after the two are others.
  EXPECT_FALSE(between(kFirst - 1, -up));
  EXPECT_FALSE(between(kFirst + 2, up));
}

}  // namespace
}  // namespace kiroku::sim
