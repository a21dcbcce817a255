#include "viewer/compare/step_matching.h"

#include "base/error.h"

namespace kiroku::compare {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::int64_t kEnd = 1000;

const std::vector<PlannedStep> kSteps{{"grasp forceps", 0, 0},
                                      {"retract forceps", 0, 2},
                                      {"hold", 2, 1},
                                      {"retract forceps", 3, 1},
                                      {"Clip the cystic artery", 4, 1}};

StepMatching by_marks(const std::vector<Mark>& marks) { return match_by_marks(kSteps, marks, kEnd); }

std::vector<std::size_t> steps_of(const StepMatching& matching) {
  std::vector<std::size_t> steps;
  for (const StepMatch& match : matching.matches) steps.push_back(match.step);
  return steps;
}

TEST(StepMatching, FindsStepsByTheirNamesInTheTextOfMarks) {
  const StepMatching matching =
      by_marks({{300, "now: CLIP the cystic   artery!"}, {100, "Grasp forceps"}, {200, "step 3"}});
  EXPECT_THAT(steps_of(matching), ElementsAre(0, 2, 4));
  EXPECT_THAT(matching.missing, ElementsAre(1, 3));
  EXPECT_TRUE(matching.in_planned_order());
  EXPECT_EQ(matching.matches[0].span.end_ns, 200);
  EXPECT_EQ(matching.matches[0].end_from, KnownFrom::kNextStep);
  EXPECT_EQ(matching.matches[2].span.end_ns, kEnd);
  EXPECT_EQ(matching.matches[2].end_from, KnownFrom::kRecordingEnd);
  EXPECT_EQ(matching.matches[2].mark, "now: CLIP the cystic   artery!");
}

TEST(StepMatching, TakesWholeWordsAndTheLongestName) {
  // "hold" is in neither "threshold" nor "holding", and step 12 is not step 1.
  const StepMatching matching = by_marks({{1, "threshold"}, {2, "holding"}, {3, "step 12"}, {4, "step"}});
  EXPECT_TRUE(matching.matches.empty());
  EXPECT_EQ(matching.unmatched.size(), 4U);
  const std::vector<PlannedStep> nested{{"clip", 0, 1}, {"clip artery", 1, 1}};
  const std::vector<Mark> marks{{1, "clip artery"}, {2, "clip"}};
  EXPECT_THAT(steps_of(match_by_marks(nested, marks, kEnd)), ElementsAre(1, 0));
}

TEST(StepMatching, ANameAmongOtherWordsBeginsNothing) {
  const std::vector<Mark> marks{
      {1, "do not hold yet"},    {2, "threshold, then hold"},  {3, "hold, then retract forceps"},
      {4, "step 3 not reached"}, {5, "step 2: hold"},          {6, "hold the camera"},
      {7, "hold not done"},      {8, "begin the end of hold"}, {9, "hold hold"}};
  const StepMatching matching = by_marks(marks);
  EXPECT_TRUE(matching.matches.empty());
  EXPECT_EQ(matching.ambiguous, (std::vector<Mark>{marks[0], marks[1], marks[2], marks[3], marks[4], marks[5],
                                                   marks[6], marks[7], marks[8]}));
  EXPECT_TRUE(matching.unmatched.empty());
  // None of them ends what runs, either.
  const StepMatching running = by_marks({{1, "hold"}, {2, "hold not done"}, {3, "over the hold artery"}});
  ASSERT_THAT(steps_of(running), ElementsAre(2));
  EXPECT_EQ(running.matches[0].span.end_ns, kEnd);
  EXPECT_EQ(running.ambiguous.size(), 2U);
}

TEST(StepMatching, FewWordsMayStandBesideAName) {
  EXPECT_THAT(steps_of(by_marks({{1, "start of the hold"}, {2, "Now: grasp forceps begins."}})),
              ElementsAre(2, 0));
  EXPECT_THAT(steps_of(by_marks({{1, "step 3: hold"}, {2, "begin step 1"}})), ElementsAre(2, 0));
  // A name with such words, or with a number in it, is a name.
  const std::vector<PlannedStep> named{{"hold", 0, 1}, {"end of step 1", 1, 1}, {"start", 2, 1}};
  EXPECT_THAT(steps_of(match_by_marks(named, std::vector<Mark>{{1, "end of step 1"}, {2, "start"}}, kEnd)),
              ElementsAre(1, 2));
}

TEST(StepMatching, GivesStepsOfTheSameNameInTheOrderOfThePlan) {
  const StepMatching matching =
      by_marks({{1, "retract forceps"}, {5, "retract forceps"}, {9, "retract forceps"}});
  EXPECT_THAT(steps_of(matching), ElementsAre(1, 3));
  EXPECT_THAT(matching.repeated, ElementsAre(Mark{9, "retract forceps"}));
  // A number says which one.
  EXPECT_THAT(steps_of(by_marks({{1, "step 4"}, {5, "retract forceps"}})), ElementsAre(3, 1));
}

TEST(StepMatching, StatesOrderRepetitionAndWhatIsMissing) {
  const StepMatching matching =
      by_marks({{10, "hold"}, {20, "grasp forceps"}, {30, "grasp forceps"}, {40, "bleeding"}});
  EXPECT_THAT(steps_of(matching), ElementsAre(2, 0));
  EXPECT_FALSE(matching.in_planned_order());
  EXPECT_THAT(matching.repeated, ElementsAre(Mark{30, "grasp forceps"}));
  EXPECT_THAT(matching.unmatched, ElementsAre(Mark{40, "bleeding"}));
  EXPECT_THAT(matching.missing, ElementsAre(1, 3, 4));
}

TEST(StepMatching, EndsAndInterruptsStepsByMarks) {
  const StepMatching matching = by_marks({{10, "grasp forceps"},
                                          {20, "grasp forceps done"},
                                          {30, "step 2"},
                                          {40, "Pause"},
                                          {55, "go on"},
                                          {70, "end of step 2"},
                                          {80, "hold"},
                                          {85, "pause"},
                                          {90, "end"}});
  ASSERT_THAT(steps_of(matching), ElementsAre(0, 1, 2));
  EXPECT_EQ(matching.matches[0].span.end_ns, 20);
  EXPECT_EQ(matching.matches[0].end_from, KnownFrom::kMark);
  EXPECT_EQ(matching.matches[1].span.end_ns, 70);
  ASSERT_EQ(matching.matches[1].pauses.size(), 1U);
  EXPECT_EQ(matching.matches[1].pauses[0].start_ns, 40);
  EXPECT_EQ(matching.matches[1].pauses[0].end_ns, 55);
  // A step that was not taken up again ended where it was interrupted.
  EXPECT_EQ(matching.matches[2].span.end_ns, 85);
  EXPECT_TRUE(matching.matches[2].pauses.empty());
  EXPECT_TRUE(matching.unmatched.empty());
}

TEST(StepMatching, AnEndWithoutItsBeginningIsNoStep) {
  const StepMatching matching = by_marks({{5, "pause"}, {10, "hold done"}, {20, "hold"}, {30, "end step 1"}});
  ASSERT_THAT(steps_of(matching), ElementsAre(2));
  EXPECT_EQ(matching.matches[0].span.end_ns, kEnd);
  EXPECT_EQ(matching.unmatched.size(), 3U);
}

StepMatch said(std::size_t step, std::int64_t start_ns, std::int64_t end_ns) {
  StepMatch match;
  match.step = step;
  match.span = {start_ns, end_ns};
  match.start_from = match.end_from = KnownFrom::kHand;
  return match;
}

TEST(StepMatching, CompletesWhatAPersonSays) {
  const StepMatching matching =
      match_by_hand(kSteps, {said(1, 50, 60), said(0, 10, 9), said(4, 70, -1)}, kEnd);
  EXPECT_THAT(steps_of(matching), ElementsAre(0, 1, 4));
  EXPECT_EQ(matching.matches[0].span.end_ns, 50);
  EXPECT_EQ(matching.matches[0].end_from, KnownFrom::kNextStep);
  EXPECT_EQ(matching.matches[1].end_from, KnownFrom::kHand);
  EXPECT_EQ(matching.matches[2].span.end_ns, kEnd);
  EXPECT_THAT(matching.missing, ElementsAre(2, 3));
}

std::string refusal(std::vector<StepMatch> matches) {
  try {
    match_by_hand(kSteps, std::move(matches), kEnd);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

TEST(StepMatching, RefusesWhatCannotBe) {
  EXPECT_THAT(refusal({said(5, 1, 2)}), HasSubstr("the plan has only 5"));
  EXPECT_THAT(refusal({said(1, 1, 2), said(1, 3, 4)}), HasSubstr("step 2 is matched twice"));
  EXPECT_THAT(refusal({said(1, 1, 5), said(2, 4, 6)}), HasSubstr("step 3 begins before step 2 ends"));
  StepMatch paused = said(1, 1, 9);
  paused.pauses = {{5, 7}, {6, 8}};
  EXPECT_THAT(refusal({paused}), HasSubstr("a pause of step 2"));
}

}  // namespace
}  // namespace kiroku::compare
