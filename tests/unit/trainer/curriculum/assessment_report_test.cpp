#include "trainer/curriculum/assessment_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::trainer {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::vector<ExclusionRecord> records() {
  std::vector<ExclusionRecord> all(4);
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i].number = static_cast<std::int64_t>(i) + 1;
    all[i].trainee = "Aoki";
    all[i].object = "a";
  }
  all[1].questionnaire = Questionnaire{{2, 1, std::nullopt}, "Good, but \"the palm\" is missing", "anna"};
  all[2].questionnaire = Questionnaire{{-1, 1, std::nullopt}, "", "ben"};
  all[3].test = true;
  all[3].sealed_case = "20260805T091502Z-3f9c21ab";
  all[3].checklist.emplace();
  all[3].checklist->items[1] = ItemState::kNotDone;
  all[3].checklist->items[7] = ItemState::kNotSeen;
  all[3].checklist->global_rating = 4;
  all[3].checklist->examiner = "Dr Sato";
  all[3].checklist->account = "root";
  return all;
}

TEST(AssessmentReport, ShowsMeansBesideTheStudysAndEachChecklist) {
  const std::vector<ReportBlock> blocks = assessment_blocks(records());
  ASSERT_EQ(blocks.size(), 2U);
  EXPECT_THAT(blocks[0].text, HasSubstr("2 questionnaires"));
  EXPECT_THAT(blocks[0].text, HasSubstr("anna of attempt 2: \"Good, but"));
  ASSERT_EQ(blocks[0].table.size(), 1 + kQuestions.size());
  EXPECT_THAT(blocks[0].table[1],
              ElementsAre("the trainer gives the feel of an organ", "2", "+0.5", "-1", "+2", "+1.3"));
  EXPECT_THAT(blocks[0].table[3], ElementsAre("showing stress helps", "0", "", "", "", "+1.7"));
  ASSERT_EQ(blocks[1].table.size(), 2U);
  EXPECT_THAT(blocks[1].table[1],
              ElementsAre("4", "Aoki", "1", "a", "6 of 7", "touches-gently", "4, good", "Dr Sato"));
  EXPECT_TRUE(assessment_blocks({ExclusionRecord()}).empty());
  EXPECT_GT(training_report(records()).size(), 1000U);
}

TEST(AssessmentReport, HasALineForEachAttemptOfWhichSomethingWasSaid) {
  EXPECT_EQ(assessments_csv(records()),
            "attempt,trainee,session,kind,object,case,organ-feel,useful,stress-helps,comment,answered_by,"
            "looks-first,touches-gently,shares-the-load,lifts-steadily,minds-the-limit,keeps-hold,"
            "keeps-the-view,lets-down-slowly,global_rating,examiner,filled_in_by\n"
            "2,Aoki,1,practice,a,,2,1,,\"Good, but \"\"the palm\"\" is missing\",anna,,,,,,,,,,,\n"
            "3,Aoki,1,practice,a,,-1,1,,,ben,,,,,,,,,,,\n"
            "4,Aoki,1,test,a,20260805T091502Z-3f9c21ab,,,,,,done,not-done,done,done,done,done,done,not-seen,"
            "4,Dr Sato,root\n");
}

}  // namespace
}  // namespace kiroku::trainer
