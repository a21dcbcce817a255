#include "viewer/api/finding_meanings.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/verify/finding_codes.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

bool has_japanese(const std::string& text) {
  // Kana and ideographs begin with these bytes in UTF-8: U+3000 to U+9FFF.
  return text.find_first_of("\xe3\xe4\xe5\xe6\xe7\xe8\xe9") != std::string::npos;
}

TEST(Meanings, StandBesideEveryFindingOfTheFormatInBothLanguages) {
  ordered_json report = {{"findings", ordered_json::array()}};
  for (const archive::FindingCode& code : archive::kFindingCodes) {
    report["findings"].push_back({{"code", code.name}, {"text", "the verifier's own sentence"}});
  }
  add_meanings(report);
  ASSERT_FALSE(report["findings"].empty());
  for (const ordered_json& finding : report["findings"]) {
    const std::string english = finding["meaning"]["en"];
    EXPECT_NE(english, finding["code"]);
    EXPECT_FALSE(has_japanese(english)) << finding["code"];
    EXPECT_TRUE(has_japanese(finding["meaning"]["ja"])) << finding["code"];
    EXPECT_EQ(finding["text"], "the verifier's own sentence");
  }
}

TEST(Meanings, OfAReportWithoutFindingsAreNone) {
  ordered_json report = {{"findings", ordered_json::array()}};
  add_meanings(report);
  EXPECT_TRUE(report["findings"].empty());
}

}  // namespace
}  // namespace kiroku::viewer
