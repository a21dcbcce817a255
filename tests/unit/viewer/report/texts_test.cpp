#include "viewer/report/texts.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/verify/finding_codes.h"
#include "viewer/report/checks.h"
#include "viewer/report/document.h"
#include "viewer/report/finding_texts.h"

namespace kiroku::report {
namespace {

/// "{0}", "{1}" of a text, each once.
std::set<std::string> values_in(std::string_view text) {
  std::set<std::string> values;
  for (std::size_t at = text.find('{'); at != std::string_view::npos; at = text.find('{', at + 1))
    values.insert(std::string(text.substr(at, 3)));
  return values;
}

TEST(Texts, SayTheSameInBothLanguages) {
  std::set<std::string_view> keys;
  for (const Text& text : kTexts) {
    EXPECT_TRUE(keys.insert(text.key).second) << text.key << " stands there twice";
    EXPECT_NE(text.english, "") << text.key;
    EXPECT_NE(text.japanese, "") << text.key;
    EXPECT_EQ(values_in(text.english), values_in(text.japanese)) << text.key;
    for (const std::string& value : values_in(text.english))
      EXPECT_THAT(value, testing::MatchesRegex("\\{[0-9]\\}"));
  }
}

TEST(Texts, PutValuesInTheirPlaces) {
  EXPECT_EQ(say(Language::kEnglish, "page", {"2", "7"}), "2 of 7");
  EXPECT_EQ(say(Language::kJapanese, "page", {"2", "7"}), "2 / 7");
  EXPECT_EQ(say_count(Language::kEnglish, 1, "one.file", "many.file"), "1 file");
  EXPECT_EQ(say_count(Language::kEnglish, 0, "one.file", "many.file"), "0 files");
}

TEST(Texts, KnowEveryFindingOfTheFormatAndNoOther) {
  std::set<std::string_view> codes;
  for (const archive::FindingCode& code : archive::kFindingCodes) {
    codes.insert(code.name);
    EXPECT_TRUE(check_of(code.name)) << code.name;
    EXPECT_NE(meaning_of(Language::kEnglish, code.name), code.name);
    EXPECT_NE(meaning_of(Language::kJapanese, code.name), code.name);
  }
  for (const FindingText& text : kFindingTexts) EXPECT_TRUE(codes.erase(text.code) == 1) << text.code;
  EXPECT_TRUE(codes.empty());
}

// What is wrong with the log beside a case says nothing of the case's own files, device or lines.
TEST(Checks, PutWhatIsFoundOfTheLogToTheLogAlone) {
  archive::VerificationReport found;
  found.entries = found.signed_entries = 9;
  found.close_entry = 8;
  found.time = archive::TimeProof::kExternal;
  for (const char* code :
       {"file-unreadable", "device-not-trusted", "checkpoint-not-by-both", "log-not-sound", "log-silent"}) {
    found.findings.push_back({code, archive::Severity::kUnproven, "log/ledger.jsonl", {}, {}, code, true});
  }
  found.findings.push_back(
      {"file-of-a-system", archive::Severity::kNote, "log/.DS_Store", {}, {}, "x", true});
  Given given;
  given.log.push_back({"log", {}});
  for (const CheckAnswer& each : answer_checks(found, given, false)) {
    const bool is_of_log = each.check == Check::kLog;
    const Answer wanted = is_of_log                        ? Answer::kUnknown
                          : each.check == Check::kContents ? Answer::kNotAsked
                                                           : Answer::kYes;
    EXPECT_EQ(each.answer, wanted) << static_cast<int>(each.check);
    EXPECT_EQ(each.notes, is_of_log ? 1U : 0U) << static_cast<int>(each.check);
  }
}

// Anybody can put a folder of any name into a case.
TEST(Checks, PutAFileOfTheCaseToItsFilesWhateverItsFolderIsCalled) {
  archive::VerificationReport found;
  found.entries = found.signed_entries = 9;
  found.findings.push_back({"file-unnamed", archive::Severity::kTampered, "log/x", {}, {}, "x"});
  Given given;
  given.log.push_back({"log", {}});
  for (const CheckAnswer& each : answer_checks(found, given, false)) {
    if (each.check == Check::kFiles) {
      EXPECT_EQ(each.answer, Answer::kNo);
    }
    if (each.check == Check::kLog) {
      EXPECT_EQ(each.answer, Answer::kUnknown);
    }
  }
}

TEST(Texts, OfUnknownLanguagesAreRefused) {
  EXPECT_EQ(parse_language("ja"), Language::kJapanese);
  EXPECT_ANY_THROW(parse_language("jp"));
}

TEST(PlainText, ShowsWhatWouldMislead) {
  EXPECT_EQ(plain_text("内視鏡 – endoscope"), "内視鏡 – endoscope");
  EXPECT_EQ(plain_text("a\nb\tc"), "a b c");
  EXPECT_EQ(plain_text("a\x1b[31m\x7f"), "a\\u{001B}[31m\\u{007F}");
  EXPECT_EQ(plain_text("x\u202Egpj.exe"), "x\\u{202E}gpj.exe");
  EXPECT_EQ(plain_text("\xff\xc3(\xe3\x81"), "\\x{FF}\\x{C3}(\\x{E3}\\x{81}");
}

}  // namespace
}  // namespace kiroku::report
