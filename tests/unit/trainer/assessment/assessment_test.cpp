#include "trainer/assessment/assessment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "trainer/report/assessment_json.h"

namespace kiroku::trainer {
namespace {

using nlohmann::json;
using testing::HasSubstr;

template <typename Action>
std::string refusal(const Action& action) {
  try {
    action();
  } catch (const UsageError& error) {
    return error.what();
  }
  return "nothing was refused";
}
std::string refused_questionnaire(const json& told) {
  return refusal([&] { (void)questionnaire_of(told); });
}
std::string refused_checklist(const json& told) {
  return refusal([&] { (void)checklist_of(told); });
}

json questionnaire() {
  return {{"answers", {{"organ-feel", 1}, {"useful", -2}, {"stress-helps", nullptr}}},
          {"comment", "The palm is missing.\n掌がない。"}};
}
json checklist() {
  json items;
  for (const ChecklistItem& item : kChecklistItems) items[std::string(item.name)] = "done";
  items["keeps-hold"] = "not-done";
  items["looks-first"] = "not-seen";
  return {{"items", items}, {"global_rating", 4}, {"examiner", "Dr Sato"}};
}
json with(json told, const std::string& pointer, const json& value) {
  told[json::json_pointer(pointer)] = value;
  return told;
}

TEST(Assessment, IsReadAsItIsTold) {
  const Questionnaire said = questionnaire_of(questionnaire());
  EXPECT_EQ(said.answers[0], 1);
  EXPECT_EQ(said.answers[1], -2);
  EXPECT_FALSE(said.answers[2]);
  json told = questionnaire_json(said);
  EXPECT_EQ(told["by"], "");
  told.erase("by");
  EXPECT_EQ(told, questionnaire());
  const Checklist ticked = checklist_of(checklist());
  EXPECT_EQ(items_done(ticked), 6U);
  EXPECT_EQ(ticked.global_rating, 4);
  told = checklist_json(ticked);
  told.erase("by");
  EXPECT_EQ(told, checklist());
}

TEST(Assessment, AnswersOutOfTheScaleAreRefused) {
  EXPECT_THAT(refused_questionnaire(with(questionnaire(), "/answers/useful", 3)),
              HasSubstr("'useful' must be from -2 to 2, not 3"));
  EXPECT_THAT(refused_questionnaire(with(questionnaire(), "/answers/useful", -3)), HasSubstr("not -3"));
  for (const json& value : {json(1.5), json("1"), json(true), json(4294967296U), json::array()})
    EXPECT_THAT(refused_questionnaire(with(questionnaire(), "/answers/useful", value)),
                HasSubstr("'useful' must be a small whole number"));
  EXPECT_THAT(refused_questionnaire(with(questionnaire(), "/answers/other", 1)), HasSubstr("no other"));
  EXPECT_THAT(refused_questionnaire(with(questionnaire(), "/by", "root")), HasSubstr("no other"));
  EXPECT_THAT(refused_questionnaire(with(questionnaire(), "/answers", 1)), HasSubstr("'answers'"));
  EXPECT_THAT(refused_questionnaire(json::array()), HasSubstr("a questionnaire must be an object"));
  json none = with(questionnaire(), "/comment", "");
  for (const Question& question : kQuestions) none["answers"][std::string(question.name)] = nullptr;
  EXPECT_THAT(refused_questionnaire(none), HasSubstr("say nothing"));
}

TEST(Assessment, TextsThatMisleadOrAreTooLongAreRefused) {
  EXPECT_THAT(refused_questionnaire(with(questionnaire(), "/comment", std::string(kLongestComment + 1, 'x'))),
              HasSubstr("at most 6000 bytes"));
  EXPECT_NO_THROW(
      (void)questionnaire_of(with(questionnaire(), "/comment", std::string(kLongestComment, 'x'))));
  EXPECT_THAT(refused_questionnaire(with(questionnaire(), "/comment", "a\u202eb")),
              HasSubstr("cannot be seen"));
  EXPECT_THAT(refused_questionnaire(with(questionnaire(), "/comment", 3)), HasSubstr("must be a text"));
  EXPECT_THAT(refused_checklist(with(checklist(), "/examiner", "")), HasSubstr("'examiner' must be a name"));
  EXPECT_THAT(refused_checklist(with(checklist(), "/examiner", "Dr\nSato")), HasSubstr("'examiner'"));
  EXPECT_THAT(refused_checklist(with(checklist(), "/examiner", std::string(101, 'x'))),
              HasSubstr("100 bytes"));
}

TEST(Assessment, AChecklistHasEveryItemAndARatingOfItsScale) {
  json fewer = checklist();
  fewer["items"].erase("keeps-hold");
  EXPECT_THAT(refused_checklist(fewer), HasSubstr("keeps-hold"));
  EXPECT_THAT(refused_checklist(with(checklist(), "/items/keeps-hold", "perhaps")),
              HasSubstr("'keeps-hold' must be done, not-done or not-seen"));
  EXPECT_THAT(refused_checklist(with(checklist(), "/items/keeps-hold", nullptr)), HasSubstr("'keeps-hold'"));
  for (const int rating : {0, 6})
    EXPECT_THAT(refused_checklist(with(checklist(), "/global_rating", rating)),
                HasSubstr("'global_rating' must be from 1 to 5"));
  EXPECT_THAT(refused_checklist(with(checklist(), "/global_rating", nullptr)), HasSubstr("'global_rating'"));
}

}  // namespace
}  // namespace kiroku::trainer
