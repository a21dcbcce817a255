#include "recorder/procedure/profile_rules.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "recorder/procedure/procedure_data.h"

namespace kiroku::recorder {
namespace {

using testing::HasSubstr;

Bytes json(const std::string& text) { return to_bytes(bytes_of(text)); }

std::string chosen(const std::vector<ProfileRule>& rules, const std::string& subject) {
  const auto choice = choose_profile(rules, json(subject));
  return choice ? choice->rule.name : "";
}

const std::vector<ProfileRule> kRules{
    {"mucosa", {"EMR", "ESD", "粘膜切除", "endoscopic mucosal resection"}, {"K653"}, Profile::kLossless, {}},
    {"laparoscopy", {"laparoscopic", "腹腔鏡"}, {}, Profile::kMpeg2, {}},
    {"stomach", {"stomach"}, {"K653"}, Profile::kUncompressed, {}}};

TEST(ProfileRules, FindWholeWordsWhateverTheirCase) {
  EXPECT_TRUE(has_word("EMR of the stomach", "emr"));
  EXPECT_TRUE(has_word("Emr", "EMR"));
  EXPECT_TRUE(has_word("planned: EMR/ESD", "esd"));
  EXPECT_TRUE(has_word("(EMR)", "EMR"));
  EXPECT_FALSE(has_word("EMRX", "EMR"));
  EXPECT_FALSE(has_word("2EMR", "EMR"));
  EXPECT_FALSE(has_word("premature", "EMR"));
  EXPECT_FALSE(has_word("ÉEMR", "EMR"));
  EXPECT_FALSE(has_word("e\xcc\x81mr", "emr")) << "an accent belongs to its letter";
  EXPECT_TRUE(has_word("preEMR, then EMR", "EMR")) << "the second one stands alone";
  EXPECT_TRUE(has_word("Größe", "GRÖSSE"));
  EXPECT_TRUE(has_word("endoscopic  mucosal\nresection", "Endoscopic Mucosal Resection"));
  EXPECT_FALSE(has_word("EMR", ""));
  EXPECT_FALSE(has_word("EMR", " "));
  EXPECT_FALSE(has_word("", "EMR"));
}

TEST(ProfileRules, FindJapaneseWordsAnywhereInEachWidth) {
  EXPECT_TRUE(has_word("早期胃癌に対する内視鏡的粘膜切除術", "粘膜切除"));
  EXPECT_TRUE(has_word("胃EMR術", "EMR")) << "ideographs are no letters of the same word";
  EXPECT_TRUE(has_word("胃ＥＭＲ", "emr")) << "full width";
  EXPECT_TRUE(has_word("ﾎﾟﾘﾍﾟｸﾄﾐｰ", "ポリペクトミー")) << "half width";
  EXPECT_FALSE(has_word("腹腔鏡下胆嚢摘出術", "粘膜切除"));
}

TEST(ProfileRules, TakeBytesThatAreNoUtf8ForNoLetters) {
  EXPECT_TRUE(has_word("\xff EMR", "EMR"));
  EXPECT_TRUE(
      has_word("\xff"
               "EMR\xc3",
               "EMR"));
  EXPECT_FALSE(has_word("\xff", "EMR"));
  EXPECT_FALSE(has_word("EM\xffR", "EMR"));
}

TEST(ProfileRules, TheFirstThatMatchesChooses) {
  EXPECT_EQ(chosen(kRules, R"({"procedure":{"description":"EMR of the stomach"}})"), "mucosa");
  EXPECT_EQ(chosen(kRules, R"({"procedure":{"description":"Laparoscopic EMR"}})"), "mucosa");
  EXPECT_EQ(chosen(kRules, R"({"procedure":{"description":"laparoscopic gastrectomy, stomach"}})"),
            "laparoscopy");
  EXPECT_EQ(chosen(kRules, R"({"procedure":{"description":"stomach"}})"), "stomach");
  EXPECT_EQ(chosen(kRules, R"({"procedure":"腹腔鏡下胃切除術"})"), "laparoscopy") << "a text";
}

TEST(ProfileRules, ACodeIsTheWholeCode) {
  EXPECT_EQ(chosen(kRules, R"({"procedure":{"code":"k653"}})"), "mucosa");
  EXPECT_EQ(chosen(kRules, R"({"procedure":{"code":"K653-2"}})"), "");
  EXPECT_EQ(chosen(kRules, R"({"procedure":{"description":"K653"}})"), "") << "a code is no word";
  EXPECT_EQ(chosen({{"empty", {}, {""}, Profile::kLossless, {}}}, R"({"procedure":{"code":""}})"), "");
}

TEST(ProfileRules, NothingIsChosenWhereNothingIsSaid) {
  for (const char* subject :
       {"{}", "[]", "EMR", "", R"({"procedure":null})", R"({"procedure":{}})",
        R"({"procedure":{"description":7,"code":["K653"]}})", R"({"patient":{"name":"EMR"}})"}) {
    EXPECT_EQ(chosen(kRules, subject), "") << subject;
  }
  EXPECT_EQ(chosen({}, R"({"procedure":"EMR"})"), "");
}

TEST(ProfileRules, ReadWhatTheHospitalSaysAsTheRecorderSealsIt) {
  ProcedureData data;
  data.description = "Endoscopic submucosal dissection (ESD)";
  const auto choice = choose_profile(kRules, subject_json(data));
  ASSERT_TRUE(choice);
  EXPECT_EQ(choice->rule.profile, Profile::kLossless);
  EXPECT_THAT(choice->why, HasSubstr("the word 'ESD'"));
}

}  // namespace
}  // namespace kiroku::recorder
