#include "sim/respiration/timed_path.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

std::string refusal(const std::string& text) {
  try {
    parse_timed_path(text, "path.csv");
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was refused";
}

TEST(TimedPath, IsEvenBetweenItsMoments) {
  const TimedPath path =
      parse_timed_path("time_s,x_mm,y_mm,z_mm,moved_mm\n0,0,0,0,0\n2,10,0,-4,11\n", "path.csv");
  EXPECT_TRUE(path.place_at(0.5).value().isApprox(Vector3(0.0025, 0, -0.001)));
  EXPECT_EQ(path.place_at(2), Vector3(0.01, 0, -0.004));
  EXPECT_FALSE(path.place_at(-0.1));
  EXPECT_FALSE(path.place_at(2.1));
  EXPECT_EQ(parse_timed_path("time_s,x_m,y_m,z_m\n0,1,2,3\n1,1,2,3\n", "p").points_m[0], Vector3(1, 2, 3));
}

TEST(TimedPath, OfABreathFollowsItself) {
  const TimedPath path = parse_timed_path("time_s,x_mm,y_mm,z_mm\n1,0,0,0\n2,10,0,0\n3,40,0,0\n", "path.csv");
  EXPECT_NEAR(path.place_in_breath(3.5).x(), 0.02, 1e-12) << "half the way back";
  EXPECT_NEAR(path.place_in_breath(4).x(), 0, 1e-12);
  EXPECT_NEAR(path.place_in_breath(4 + 3 * 1000 + 0.5).x(), 0.005, 1e-9);
  EXPECT_NEAR(path.place_in_breath(-1).x(), 0.01, 1e-12);
}

TEST(TimedPath, RefusesWithTheLine) {
  EXPECT_THAT(refusal("time_s,x_mm,y_mm,z_mm\n0,0,0,0\n0,1,1,1\n"), HasSubstr("line 3: it is not later"));
  EXPECT_THAT(refusal("time_s,x_mm,y_mm,z_mm\n0,0,0,0\n"), HasSubstr("fewer than two places"));
  EXPECT_THAT(refusal("time_s,x_mm,y_mm\n0,0,0\n1,0,0\n"), HasSubstr("z_mm"));
}

}  // namespace
}  // namespace kiroku::sim
