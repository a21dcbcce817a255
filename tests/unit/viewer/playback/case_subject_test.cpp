#include "viewer/playback/case_subject.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::playback {
namespace {

using testing::HasSubstr;
using testing::SizeIs;

TEST(CaseSubject, IsReadAsARecorderWritesIt) {
  const auto subject = read_subject(
      R"({"patient":{"id":"17","family":"Yamada","given":"Tarou","name":"Yamada^Tarou=\u5c71\u7530^\u592a\u90ce",)"
      R"("birth_date":"1980-01-15","sex":"M"},"procedure":{"description":"Cholecystectomy","code":"5-511"},)"
      R"("staff":[{"role":"surgeon","name":"Sato^Hanako"}],"origin":"worklist","chosen":"nearest"})");
  ASSERT_TRUE(subject);
  EXPECT_EQ(subject->patient, "Yamada Tarou / \u5c71\u7530 \u592a\u90ce");
  EXPECT_EQ(subject->patient_id, "17");
  EXPECT_EQ(subject->procedure, "Cholecystectomy");
  ASSERT_THAT(subject->staff, SizeIs(1));
  EXPECT_EQ(subject->staff[0].name, "Sato Hanako");
  EXPECT_THAT(subject->searchable, HasSubstr("yamada tarou"));
}

TEST(CaseSubject, IsReadAsAPersonWroteIt) {
  const auto subject = read_subject(
      R"({"patient":"Doe","procedure":"Hernia","staff":{"surgeon":"Dr. Sato"},"note":{"x":"Left"}})");
  ASSERT_TRUE(subject);
  EXPECT_EQ(subject->patient, "Doe");
  EXPECT_EQ(subject->procedure, "Hernia");
  ASSERT_THAT(subject->staff, SizeIs(1));
  EXPECT_EQ(subject->staff[0].role, "surgeon");
  EXPECT_THAT(subject->searchable, HasSubstr("left"));
}

TEST(CaseSubject, MayBeAnythingThatIsAnObject) {
  EXPECT_FALSE(read_subject("[]"));
  EXPECT_FALSE(read_subject("{"));
  for (const char* odd : {"{}", R"({"patient":7,"procedure":[],"staff":null})", R"({"staff":[1,[],{}]})",
                          R"({"patient":{"name":{}},"training":[]})"}) {
    const auto subject = read_subject(odd);
    ASSERT_TRUE(subject) << odd;
    EXPECT_EQ(subject->patient, "") << odd;
    EXPECT_THAT(subject->staff, SizeIs(0)) << odd;
  }
}

}  // namespace
}  // namespace kiroku::playback
