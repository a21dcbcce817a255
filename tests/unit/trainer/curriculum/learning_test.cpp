#include "trainer/curriculum/learning.h"

#include <map>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/unit/trainer/made_object.h"
#include "trainer/curriculum/simulated_study.h"

namespace kiroku::trainer {
namespace {

using testing::HasSubstr;

ExclusionRecord record(const std::string& trainee, const std::string& group, int session, double stress_pa,
                       bool test = true) {
  ExclusionRecord made;
  made.trainee = trainee;
  made.group = group;
  made.session = session;
  made.test = test;
  made.object = "a";
  made.fingers = 3;
  made.score.largest_von_mises_pa = stress_pa;
  return made;
}

std::vector<ExclusionRecord> two_groups() {
  std::vector<ExclusionRecord> records;
  for (int session = 1; session <= 2; ++session) {
    for (int trainee = 0; trainee < 3; ++trainee) {
      records.push_back(
          record("s" + std::to_string(trainee), "shown", session, 1e3 * (40 + trainee - 10 * session)));
      records.push_back(record("h" + std::to_string(trainee), "hidden", session, 1e3 * (40 + 2 * trainee)));
      records.push_back(record("h" + std::to_string(trainee), "hidden", session, 9e9, false));  // practice
    }
  }
  return records;
}

TEST(LearningCurve, IsOfTestsByGroupAndSessionWithTheirSpread) {
  const auto curves = learning_curves(two_groups(), "a", Measure::kStress);
  ASSERT_EQ(curves.size(), 2U);
  EXPECT_EQ(curves[0].group, "hidden");
  ASSERT_EQ(curves[1].points.size(), 2U);
  EXPECT_EQ(curves[0].points[1].summary.mean, 42);
  EXPECT_EQ(curves[1].points[0].summary.mean, 31);
  EXPECT_EQ(curves[1].points[1].summary.mean, 21);
  EXPECT_EQ(curves[0].points[1].summary.standard_deviation, 2);
  EXPECT_TRUE(learning_curves(two_groups(), "b", Measure::kStress).empty());
}

TEST(LearningCurve, TakesTheMeanOfATraineesTests) {
  const auto curves = learning_curves(
      {record("x", "g", 1, 1e3), record("x", "g", 1, 3e3), record("y", "g", 1, 8e3)}, "a", Measure::kStress);
  ASSERT_EQ(curves.size(), 1U);
  EXPECT_EQ(curves[0].points[0].summary.count, 2U);  // trainees, not attempts
  EXPECT_EQ(curves[0].points[0].summary.mean, 5);
}

TEST(LearningCurve, LeavesOutWhatWasBrokenOffOrGivenUp) {
  std::vector<ExclusionRecord> records{record("x", "g", 1, 1e3), record("x", "g", 1, 9e9),
                                       record("x", "g", 2, 9e9)};
  records[1].ending = Ending::kBrokenOff;
  records[2].ending = Ending::kGivenUp;
  const auto curves = learning_curves(records, "a", Measure::kStress);
  ASSERT_EQ(curves.size(), 1U);
  ASSERT_EQ(curves[0].points.size(), 1U);
  EXPECT_EQ(curves[0].points[0].summary.mean, 1);
}

TEST(LearningCurve, OfATraineeIsTheirOwn) {
  std::vector<ExclusionRecord> records{record("x", "g", 1, 2e3), record("y", "g", 1, 8e3),
                                       record("x", "g", 2, 1e3), record("x", "g", 2, 3e3),
                                       record("x", "g", 2, 9e3)};
  records.back().fingers = 5;
  const std::vector<OwnCurve> curves = learning_curves_of(records, "x", "a", Measure::kStress);
  ASSERT_EQ(curves.size(), 2U);
  const std::vector<std::pair<int, double>> expected{{1, 2}, {2, 2}}, of_five{{2, 9}};
  EXPECT_EQ(curves[0].points, expected);
  EXPECT_EQ(curves[1].fingers, 5U);
  EXPECT_EQ(curves[1].points, of_five);
}

TEST(LearningCurve, TellsNumbersOfFingersApart) {
  std::vector<ExclusionRecord> records = two_groups();
  for (int trainee = 0; trainee < 3; ++trainee) {
    records.push_back(record("s" + std::to_string(trainee), "shown", 2, 9e9));
    records.back().fingers = 1;
  }
  const auto curves = learning_curves(records, "a", Measure::kStress);
  ASSERT_EQ(curves.size(), 3U);
  EXPECT_EQ(curves[1].group, "shown");
  EXPECT_EQ(curves[1].fingers, 1U);
  EXPECT_EQ(curves[2].points[1].summary.mean, 21);  // with three, as without those of one
  const auto found = compare_at_end(records, "a", Measure::kStress);
  ASSERT_EQ(found.size(), 1U);  // hidden has none with one finger
  EXPECT_EQ(found[0].fingers, 3U);
  EXPECT_EQ(found[0].comparison.difference, 21);
  EXPECT_THAT(curves_csv(records), HasSubstr(",shown,1,2,3,"));
}

TEST(LearningCurve, NeverMixesFrictionDamageLimitAndMesh) {
  std::vector<ExclusionRecord> records = two_groups();
  const AttemptConditions usual{0.5, 1e5, 2012, 7654};
  for (ExclusionRecord& made : records) made.conditions = usual;
  // The same trainees once more in session 2, each time with one condition changed; and as kept long ago.
  std::vector<std::optional<AttemptConditions>> others(5, usual);
  others[0]->friction = 0;
  others[1]->damage_pa = 5e4;
  others[2]->vertices = 4000;
  others[3]->tetrahedra = 7655;
  others[4].reset();
  for (const auto& conditions : others) {
    for (int trainee = 0; trainee < 3; ++trainee) {
      records.push_back(record("s" + std::to_string(trainee), "shown", 2, 9e9));
      records.back().conditions = conditions;
    }
  }
  const auto curves = learning_curves(records, "a", Measure::kStress);
  ASSERT_EQ(curves.size(), 7U);
  int of_usual = 0;
  for (const LearningCurve& curve : curves) {
    if (curve.conditions != usual) {
      EXPECT_EQ(curve.points.size(), 1U);
      EXPECT_EQ(curve.points[0].summary.mean, 9e6);
      continue;
    }
    ++of_usual;
    if (curve.group == "shown") {
      EXPECT_EQ(curve.points[1].summary.mean, 21);
    }
  }
  EXPECT_EQ(of_usual, 2);
  const auto found = compare_at_end(records, "a", Measure::kStress);
  ASSERT_EQ(found.size(), 1U);  // hidden has the usual conditions alone
  EXPECT_EQ(found[0].conditions, usual);
  EXPECT_EQ(found[0].comparison.difference, 21);
  EXPECT_EQ(learning_curves_of(records, "s0", "a", Measure::kStress).size(), 6U);
  EXPECT_THAT(curves_csv(records), HasSubstr(",0.5,1e+05,2012,7654\n"));
  EXPECT_THAT(attempts_csv(records), HasSubstr(",0.5,50000,2012,7654,,\n"));
  EXPECT_THAT(attempts_csv(records), HasSubstr(",,,,,,\n"));
  EXPECT_GT(training_report(records).size(), 1000U);
  EXPECT_EQ(text_of(usual), "friction 0.5, damage limit 100 kPa, mesh of 2012 vertices and 7654 tetrahedra");
}

TEST(LearningCurve, OfThePageIsThatOfTheTraineesNewestConditions) {
  std::vector<ExclusionRecord> records{record("x", "g", 1, 1e3), record("y", "g", 1, 2e3),
                                       record("x", "g", 2, 3e3), record("y", "g", 2, 4e3),
                                       record("z", "g", 1, 5e3, false)};
  const AttemptConditions first{0.5, 1e5, 2000, 7000}, second{0, 1e5, 2000, 7000};
  records[0].conditions = records[1].conditions = records[3].conditions = first;
  records[2].conditions = second;
  EXPECT_EQ(comparable_records(records, "x", "a").size(), 1U);
  EXPECT_EQ(comparable_records(records, "y", "a").size(), 3U);
  EXPECT_EQ(comparable_records(records, "z", "a").size(), 3U);  // no test of its own: the newest of anybody's
  EXPECT_TRUE(comparable_records(records, "x", "b").empty());
}

TEST(TraineeProgress, AsksForPracticeBeforeATestAndForATestAfterPractice) {
  EXPECT_EQ(not_allowed({2, 80}, false, 180), "");
  EXPECT_EQ(not_allowed({2, 80}, true, 180),
            "has practised 1:20 of the 3:00 minutes of session 2: the test comes after them");
  EXPECT_EQ(not_allowed({2, 179.98}, true, 180), "");
  EXPECT_EQ(not_allowed({2, 185}, false, 180),
            "has practised 3:05 of the 3:00 minutes of session 2: the test comes now");
  EXPECT_EQ(not_allowed({1, 0}, true, 0), "");
  EXPECT_EQ(not_allowed({1, 500}, false, 0), "");
}

// Whoever breaks tests off until one goes well has the same score as who did well at once.
TEST(TraineeProgress, CountsTestsThatCameBeforeTheOneThatCounts) {
  std::vector<ExclusionRecord> records;
  const auto add = [&](ExclusionRecord made, Ending ending) {
    made.ending = ending;
    made.number = static_cast<std::int64_t>(records.size()) + 1;
    records.push_back(made);
  };
  add(record("x", "g", 1, 1e3, false), Ending::kBrokenOff);  // practice
  add(record("x", "g", 1, 9e9), Ending::kBrokenOff);
  add(record("y", "g", 1, 9e9), Ending::kBrokenOff);  // somebody else's
  add(record("x", "g", 1, 9e9), Ending::kGivenUp);
  EXPECT_EQ(tests_without_result_before(records, record("x", "g", 1, 0)), 2U) << "one that begins now";
  add(record("x", "g", 1, 1e3), Ending::kDone);
  EXPECT_EQ(tests_without_result_before(records, records.back()), 2U);
  add(record("x", "g", 2, 1e3), Ending::kDone);
  EXPECT_EQ(tests_without_result_before(records, records.back()), 0U) << "of another session";
  EXPECT_EQ(tests_without_result_before(records, records[1]), 0U);
}

TEST(TraineeProgress, ASessionIsOverWithItsTest) {
  std::vector<ExclusionRecord> records;
  EXPECT_EQ(progress_of(records, "x", "a").session, 1);
  records.push_back(record("x", "g", 1, 1e3, false));
  records.back().score.time_s = 40;
  records.push_back(record("x", "g", 1, 1e3, false));
  records.back().score.time_s = 20;
  records.back().ending = Ending::kBrokenOff;
  EXPECT_EQ(progress_of(records, "x", "a").practised_s, 60);
  records.push_back(record("x", "g", 1, 1e3));
  records.back().ending = Ending::kBrokenOff;
  EXPECT_EQ(progress_of(records, "x", "a").session, 1);  // a test that broke off is taken again
  records.push_back(record("x", "g", 1, 1e3));
  EXPECT_EQ(progress_of(records, "x", "a").session, 2);
  EXPECT_EQ(progress_of(records, "x", "a").practised_s, 0);
  EXPECT_EQ(progress_of(records, "y", "a").session, 1);
  EXPECT_EQ(progress_of(records, "x", "b").session, 1);
}

TEST(GroupComparison, IsOfTheLastSessionThatBothHave) {
  std::vector<ExclusionRecord> records = two_groups();
  records.push_back(record("s0", "shown", 3, 1));
  const auto found = compare_at_end(records, "a", Measure::kStress);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].session, 2);
  EXPECT_EQ(found[0].comparison.difference, 21);
  ASSERT_TRUE(found[0].comparison.test);
  // 42 and 21, standard deviations 2 and 1, three each: t = 21 / sqrt(5 / 3).
  EXPECT_NEAR(found[0].comparison.test->t, 16.2665, 1e-4);
}

TEST(TrainingReport, SaysWhatIsSimulatedAndWhereAGroupIsTooSmall) {
  std::vector<ExclusionRecord> records = two_groups();
  EXPECT_GT(training_report(records).size(), 1000U);
  EXPECT_THROW((void)training_report({}), UsageError);
  records = {record("x", "g", 1, 1e3), record("y", "h", 1, 2e3)};
  const auto found = compare_at_end(records, "a", Measure::kStress);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_FALSE(found[0].comparison.test);
  EXPECT_THAT(found[0].comparison.why_no_test, HasSubstr("at least 3"));
  EXPECT_THAT(curves_csv(records), HasSubstr("a,\"largest von Mises stress, kPa\",g,3,1,1,1,,,,,,,\n"));
  records[0].simulated = true;
  records[0].trainee = "a \"b\", c";
  records[1].instrument = "retractor";
  EXPECT_THAT(attempts_csv(records),
              HasSubstr("\"a \"\"b\"\", c\",g,yes,1,test,no,a,3,no,time-over,0,1000,"));
  EXPECT_THAT(attempts_csv(records), testing::EndsWith(",retractor\n"));
}

TEST(SimulatedStudy, RunsFromSessionsToATest) {
  OrganObject object = made_object(ObjectKind::kLiver, 900);
  const ExclusionTask task = exclusion_task(ObjectKind::kLiver);
  const ExclusionBody body(std::move(object), task);
  SimulatedStudy study;
  study.shown = 4;
  study.hidden = 3;
  study.sessions = 2;
  study.practice_s = 40;
  const std::vector<ExclusionRecord> records = run_simulated_study(body, study);
  std::map<std::string, double> practised_s;
  std::set<std::string> trainees;
  int tests = 0;
  std::ptrdiff_t done = 0;
  for (const ExclusionRecord& made : records) {
    EXPECT_TRUE(made.simulated);
    EXPECT_THAT(made.trainee, HasSubstr("simulated"));
    trainees.insert(made.trainee);
    done += made.score.done ? 1 : 0;
    tests += made.test ? 1 : 0;
    EXPECT_EQ(made.stress_shown, !made.test && made.group == kStressShown);
    if (!made.test) practised_s[made.trainee + std::to_string(made.session)] += made.score.time_s;
  }
  EXPECT_EQ(trainees.size(), 7U);
  EXPECT_EQ(tests, 14);
  ASSERT_EQ(practised_s.size(), 14U);
  for (const auto& [session, seconds] : practised_s) EXPECT_NEAR(seconds, 40, 0.2) << session;
  EXPECT_GT(done, std::ssize(records) / 2);
  EXPECT_EQ(plot_of_study(records, "a", Measure::kStress).series.size(), 2U);
  const auto found = compare_at_end(records, "a", Measure::kStress);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].session, 2);
  EXPECT_TRUE(found[0].comparison.test);
  study.sessions = 0;
  EXPECT_THROW((void)run_simulated_study(body, study), UsageError);
}

}  // namespace
}  // namespace kiroku::trainer
