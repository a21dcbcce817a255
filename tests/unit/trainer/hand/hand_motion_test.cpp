#include "trainer/hand/hand_motion.h"

#include <algorithm>
#include <chrono>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

using testing::HasSubstr;

HandMotion turning() {
  HandMotion motion;
  motion.fingers = 2;
  for (const double time_s : {0.0, 1.0, 3.0}) {
    sim::Pose pose;
    pose.position_m = {time_s / 3, 0.1, -time_s};
    pose.orientation = Eigen::AngleAxisd(time_s, sim::Vector3::UnitZ());
    motion.times_s.push_back(time_s);
    motion.poses.push_back({pose, sim::Pose()});
  }
  return motion;
}

std::string refusal(const std::string& text) {
  try {
    (void)parse_hand_motion(text, "a.hand");
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was refused";
}

TEST(HandMotion, IsReadBackToTheBit) {
  const HandMotion motion = turning(), again = parse_hand_motion(text_of(motion), "a.hand");
  EXPECT_EQ(again.times_s, motion.times_s);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(again.poses[i][0].position_m, motion.poses[i][0].position_m);
    EXPECT_EQ(again.poses[i][0].orientation.coeffs(), motion.poses[i][0].orientation.coeffs());
  }
}

/// A wrist came after the first moment.
TEST(HandMotion, OfAWristIsReadBackToTheBitAndPlayed) {
  HandMotion motion = turning();
  motion.wrists = {std::nullopt, sim::Pose{{0.1, -0.2, 0.3}, motion.poses[1][0].orientation},
                   sim::Pose{{0.3, -0.2, 0.3}, motion.poses[2][0].orientation}};
  const std::string text = text_of(motion);
  EXPECT_THAT(text, testing::StartsWith("kiroku-hand-motion 2\nfingers 2\n"));
  const HandMotion again = parse_hand_motion(text, "a.hand");
  ASSERT_EQ(again.wrists.size(), 3U);
  EXPECT_FALSE(again.wrists[0]);
  for (const std::size_t i : {1U, 2U}) {
    ASSERT_TRUE(again.wrists[i]);
    EXPECT_EQ(again.wrists[i]->position_m, motion.wrists[i]->position_m);
    EXPECT_EQ(again.wrists[i]->orientation.coeffs(), motion.wrists[i]->orientation.coeffs());
  }
  EXPECT_FALSE(again.wrist_at(0.5));
  EXPECT_TRUE(again.wrist_at(2)->position_m.isApprox(sim::Vector3(0.2, -0.2, 0.3)));
  // Played a second a step, and kept again.
  MotionPlayer player(again, 1);
  MotionRecorder recorder(player, 1, 3);
  std::vector<sim::Pose> poses(2);
  for (const bool has_wrist : {false, true, true, true}) {
    ASSERT_TRUE(recorder.read(poses));
    EXPECT_EQ(recorder.has_wrist(), has_wrist);
    recorder.write(std::vector<sim::Vector3>(2, sim::Vector3::Zero()));
  }
  const HandMotion kept = recorder.motion();
  ASSERT_EQ(kept.wrists.size(), 4U);
  EXPECT_FALSE(kept.wrists[0]);
  EXPECT_EQ(kept.wrists[3]->position_m, motion.wrists[2]->position_m);
}

TEST(HandMotion, IsEvenBetweenItsMomentsAndStaysAtItsEnds) {
  const HandMotion motion = turning();
  EXPECT_TRUE(motion.at(2)[0].position_m.isApprox(sim::Vector3(2.0 / 3, 0.1, -2)));
  EXPECT_NEAR(Eigen::AngleAxisd(motion.at(2)[0].orientation).angle(), 2, 1e-12);
  EXPECT_EQ(motion.at(-1)[0].position_m, motion.poses[0][0].position_m);
  EXPECT_EQ(motion.at(9)[0].position_m, motion.poses[2][0].position_m);
}

TEST(HandMotion, TellsWhatIsWrongWithAFile) {
  EXPECT_THAT(refusal("P6 3"), HasSubstr("a.hand, line 1: this is no hand motion"));
  const std::string head = "kiroku-hand-motion 1\n";
  EXPECT_THAT(refusal(head + "fingers 0\n"), HasSubstr("line 2: 'fingers N'"));
  EXPECT_THAT(refusal(head + "fingers 1\n0 0 0 0 1 0 0\n"), HasSubstr("line 3: a moment of 1 fingers is 8"));
  EXPECT_THAT(refusal(head + "fingers 1\n0 nan 0 0 1 0 0 0\n"), HasSubstr("finite"));
  EXPECT_THAT(refusal(head + "fingers 1\n0 0 0 0 2 0 0 0\n"), HasSubstr("finger 1 is not of length 1"));
  EXPECT_THAT(refusal(head + "fingers 1\n1 0 0 0 1 0 0 0\n1 0 0 0 1 0 0 0\n"), HasSubstr("line 4: times"));
  EXPECT_THAT(refusal(head + "fingers 1\n"), HasSubstr("without a moment"));
  const std::string pose = " 0 0 0 1 0 0 0", second = "kiroku-hand-motion 2\n";
  EXPECT_THAT(refusal(head + "fingers 1\n0" + pose + pose + "\n"), HasSubstr("of 1 fingers is 8"));
  EXPECT_THAT(refusal(second + "fingers 1\n0" + pose + " 0\n"),
              HasSubstr("seven more where there is a wrist"));
  EXPECT_THAT(refusal(second + "fingers 1\n0" + pose + " 0 0 0 3 0 0 0\n"), HasSubstr("of the wrist is not"));
  EXPECT_EQ(refusal(second + "fingers 1\n0" + pose + pose + "\n"), "nothing was refused");
}

/// Time that a test moves by hand.
class PlayedClock : public sim::SchedulerClock {
 public:
  std::chrono::nanoseconds now() override { return time; }
  void sleep_until(std::chrono::nanoseconds until) override { time = std::max(time, until); }
  std::chrono::nanoseconds time = std::chrono::hours(7);
};

/// A loop that takes three periods for every other step skips two there: it makes half of its steps.
TEST(HandMotion, IsRecordedInRealTimeWhereALoopIsLate) {
  constexpr double kPeriodSeconds = 1e-3;
  MotionPlayer player(turning(), kPeriodSeconds);
  PlayedClock clock;
  MotionRecorder recorder(player, kPeriodSeconds, 5, clock);
  std::vector<sim::Pose> poses(2);
  const std::vector<sim::Vector3> none(2, sim::Vector3::Zero());
  for (int step = 0; step < 2000; ++step) {
    EXPECT_TRUE(recorder.read(poses));
    recorder.write(none);
    clock.time += std::chrono::milliseconds(step % 2 == 0 ? 1 : 3);
  }
  const HandMotion found = recorder.motion();
  EXPECT_EQ(found.times_s.front(), 0);
  EXPECT_NEAR(found.duration_s(), 4, 0.012);
  // What the player gave after so many steps was given in twice the time.
  for (const double time_s : {0.5, 1.5, 1.9})
    EXPECT_TRUE(found.at(2 * time_s)[0].position_m.isApprox(turning().at(time_s)[0].position_m, 1e-2));
  for (std::size_t moment = 1; moment < found.times_s.size(); ++moment)
    ASSERT_GT(found.times_s[moment], found.times_s[moment - 1]);
}

TEST(HandMotion, WhatIsPlayedIsWhatIsRecorded) {
  MotionPlayer player(turning(), 1e-3);
  MotionRecorder recorder(player, 1e-3, 2);
  std::vector<sim::Pose> poses(2);
  const std::vector<sim::Vector3> none(2, sim::Vector3::Zero());
  for (int step = 0; step < 3000; ++step) {
    EXPECT_TRUE(recorder.read(poses));
    recorder.write(none);
  }
  const HandMotion found = recorder.motion();
  EXPECT_EQ(found.times_s.size(), 201U);  // 2 s, and no more than there was room for
  for (const double time_s : {0.0, 0.5, 1.5, 1.99})
    EXPECT_TRUE(found.at(time_s)[0].position_m.isApprox(turning().at(time_s)[0].position_m, 1e-9));
}

}  // namespace
}  // namespace kiroku::trainer
