#include "trainer/curriculum/learning_trainee.h"

#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

TEST(Shown, IsStressForWhoSeesItAndForceForAllOthers) {
  ExclusionScore score;
  score.largest_von_mises_pa = 4e4;
  score.peak_force_n = 3;
  EXPECT_EQ(shown_of(score, true).cost, 4e4);
  EXPECT_EQ(shown_of(score, false).cost, 3);
}

TEST(Shown, DoneGoesBeforeLittleStress) {
  EXPECT_TRUE(better({true, 1, 9}, {false, 0.5, 1}));
  EXPECT_FALSE(better({false, 0.5, 1}, {true, 1, 9}));
  EXPECT_TRUE(better({true, 1, 3}, {true, 1, 4}));
  EXPECT_FALSE(better({true, 1, 4}, {true, 1, 4}));
  EXPECT_TRUE(better({false, 0.8, 9}, {false, 0.5, 1}));
}

TEST(LearningTrainee, AimsAtWhatWasBetterAndAtNothingElse) {
  LearningTrainee trainee(3, 5);
  const auto after = [&](bool explores, const Shown& shown) {
    const LiftPlan out = trainee.next(explores);
    trainee.learn(shown);
    return out;
  };
  const LiftPlan first = after(true, {true, 1, 10});
  const std::vector<double> aimed_m = trainee.aim().offset_m;
  // What came out is that but for the hand's noise.
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(first.offset_m[i], aimed_m[i], 5 * kMotorNoise.finger_m);
  EXPECT_NE(first.offset_m, aimed_m);
  after(true, {true, 1, 11});
  EXPECT_EQ(trainee.aim().offset_m, aimed_m);
  after(true, {false, 0.4, 1});
  EXPECT_EQ(trainee.aim().offset_m, aimed_m);
  after(true, {true, 1, 9});
  EXPECT_NE(trainee.aim().offset_m, aimed_m);
  // A test tries out nothing.
  const std::vector<double> better_m = trainee.aim().offset_m;
  const LiftPlan test = trainee.next(false);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(test.offset_m[i], better_m[i], 5 * kMotorNoise.finger_m);
}

TEST(LearningTrainee, LearnsWhatItIsShownWhateverThatIs) {
  // Shown how far its fingers are apart it evens them out; shown the opposite it spreads them; shown nothing
  // that differs it stays as it was.
  const auto unevenness = [](const LiftPlan& plan) {
    double sum = 0;
    for (const double offset_m : plan.offset_m) sum += std::abs(offset_m - plan.offset_m[0]);
    return sum;
  };
  // Of some it happens that they begin evenly: so many together.
  constexpr std::uint32_t kTrainees = 30;
  const auto after = [&](double sign, int attempts) {
    double sum = 0;
    for (std::uint32_t seed = 1; seed <= kTrainees; ++seed) {
      LearningTrainee trainee(3, seed);
      for (int attempt = 0; attempt < attempts; ++attempt) {
        const LiftPlan plan = trainee.next(true);
        trainee.learn({true, 1, sign * unevenness(plan)});
      }
      sum += unevenness(trainee.aim());
    }
    return sum;
  };
  EXPECT_LT(after(1, 80), 0.2 * after(0, 80));
  EXPECT_GT(after(-1, 80), 2 * after(0, 80));
  EXPECT_EQ(after(0, 80), after(0, 1));
}

TEST(LearningTrainee, IsTheSameOfTheSameSeed) {
  LearningTrainee one(3, 2), other(3, 2), third(3, 3);
  EXPECT_EQ(one.next(true).offset_m, other.next(true).offset_m);
  EXPECT_NE(one.next(true).offset_m, third.next(true).offset_m);
  EXPECT_THROW(LearningTrainee(6, 1), UsageError);
}

}  // namespace
}  // namespace kiroku::trainer
