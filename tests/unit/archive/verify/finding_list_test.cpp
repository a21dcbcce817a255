#include "archive/verify/finding_list.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/limits.h"

namespace kiroku::archive {
namespace {

std::size_t bytes_of_all(const std::vector<Finding>& findings) {
  std::size_t bytes = 0;
  for (const Finding& each : findings) {
    bytes += sizeof(Finding) + each.code.size() + each.file.size() + each.text.size();
  }
  return bytes;
}

std::vector<std::string> texts_of(const std::vector<Finding>& findings, const std::string& code) {
  std::vector<std::string> texts;
  for (const Finding& each : findings) {
    if (each.code == code) {
      texts.push_back(each.text);
    }
  }
  return texts;
}

TEST(FindingList, CutsLongTextsAndNamesAtACharacter) {
  FindingList list;
  list.add("gap", {std::string(5'000, 'f')}, "a" + std::string(5'000, 'x'));
  std::string accents;
  while (accents.size() < 5'000) {
    accents += "é";
  }
  list.add("recovered", {"x"}, accents);
  const std::vector<Finding> findings = list.take();
  ASSERT_EQ(findings.size(), 2U);
  EXPECT_EQ(findings[0].file.size(), kMaximumFindingText);
  EXPECT_EQ(findings[0].text.size(), kMaximumFindingText);
  EXPECT_TRUE(findings[0].text.ends_with("xx…"));
  EXPECT_EQ(findings[1].text.size(), kMaximumFindingText - 1) << "half a character would stand at the end";
  EXPECT_TRUE(findings[1].text.ends_with("éé…"));
}

TEST(FindingList, LeavesATextThatJustFits) {
  FindingList list;
  const std::string text(kMaximumFindingText, 'x');
  list.add("gap", {text}, text);
  const std::vector<Finding> findings = list.take();
  EXPECT_EQ(findings.at(0).text, text);
  EXPECT_EQ(findings.at(0).file, text);
}

TEST(FindingList, CountsWhatItDoesNotKeepAndStillDecidesByIt) {
  FindingList list;
  for (std::uint64_t i = 0; i < 3 * kMostFindingsOfOneCode; ++i) {
    list.add("gap", {"ledger.jsonl", i}, "t");
  }
  list.add("ledger-cut", {"ledger.jsonl"}, "the last one");
  EXPECT_EQ(list.worst(), Severity::kTampered);
  const std::vector<Finding> findings = list.take();
  EXPECT_EQ(texts_of(findings, "gap").size(), kMostFindingsOfOneCode);
  EXPECT_THAT(texts_of(findings, "ledger-cut"), testing::ElementsAre("the last one"));
  EXPECT_THAT(texts_of(findings, "more-findings"),
              testing::ElementsAre("there are 2000 more findings of code gap"));
}

TEST(FindingList, KeepsOneOfEachCodeHoweverFullItIs) {
  FindingList list;
  const std::string longest(kMaximumFindingText, 'x');
  // Enough of many codes that all together are too many.
  const auto fill = [&](auto... codes) {
    for (std::uint64_t i = 0; i < kMostFindingsOfOneCode; ++i) {
      (list.add(codes, {longest, i}, longest), ...);
    }
  };
  fill(CodeName("gap"), CodeName("recovered"), CodeName("token-missed"), CodeName("file-missing"),
       CodeName("file-unnamed"), CodeName("entry-malformed"), CodeName("segments-erased"),
       CodeName("token-order"), CodeName("clock-stepped"), CodeName("name-clash"), CodeName("part-file"),
       CodeName("utc-went-back"));
  list.add("segment-hole", {"ledger.jsonl"}, "the first of its code");
  list.add("segment-hole", {"ledger.jsonl"}, "the second of its code");
  const std::vector<Finding> findings = list.take();
  EXPECT_THAT(texts_of(findings, "segment-hole"), testing::ElementsAre("the first of its code"));
  EXPECT_THAT(texts_of(findings, "more-findings"),
              testing::Contains("there are 1 more findings of code segment-hole"));
  EXPECT_LT(bytes_of_all(findings), kMaximumFindingBytes + (1U << 20U));
}

TEST(FindingList, TakesFromAnotherAlsoWhatThatOnlyCounted) {
  FindingList of_log;
  for (std::uint64_t i = 0; i < kMostFindingsOfOneCode + 5; ++i) {
    of_log.add("gap", {"ledger.jsonl", i}, "t");
  }
  FindingList list;
  list.add("gap", {"ledger.jsonl"}, "its own");
  list.take_from(of_log, "log");
  EXPECT_EQ(list.worst(), Severity::kGap);
  const std::vector<Finding> findings = list.take();
  EXPECT_EQ(texts_of(findings, "gap").size(), kMostFindingsOfOneCode);
  EXPECT_EQ(findings.front().file, "log/ledger.jsonl");
  EXPECT_TRUE(findings.front().of_log);
  EXPECT_EQ(std::ranges::count(findings, false, &Finding::of_log), 2);  // its own, and what is only counted
  EXPECT_THAT(texts_of(findings, "more-findings"),
              testing::ElementsAre("there are 6 more findings of code gap"));
  EXPECT_TRUE(of_log.take().empty());
}

TEST(FindingList, TakesFromAnotherUnderOtherCodesAlsoWhatThatOnlyCounted) {
  FindingList of_log;
  for (std::uint64_t i = 0; i < kMostFindingsOfOneCode + 5; ++i) {
    of_log.add("entry-malformed", {"ledger.jsonl", i}, "t");
  }
  of_log.add("gap", {"ledger.jsonl"}, "g");
  FindingList list;
  list.take_from(of_log, "log", [](const FindingCode& code) {
    return code.severity == Severity::kTampered ? std::optional(CodeName("log-not-sound")) : std::nullopt;
  });
  EXPECT_TRUE(list.has("log-not-sound"));
  EXPECT_FALSE(list.has("entry-malformed"));
  EXPECT_EQ(list.worst(), Severity::kUnproven);
  const std::vector<Finding> findings = list.take();
  EXPECT_EQ(texts_of(findings, "gap"), std::vector<std::string>{"g"});
  ASSERT_EQ(texts_of(findings, "log-not-sound").size(), kMostFindingsOfOneCode);
  EXPECT_EQ(findings.front().text, "entry-malformed: t");
  EXPECT_THAT(texts_of(findings, "more-findings"),
              testing::ElementsAre("there are 5 more findings of code log-not-sound"));
}

}  // namespace
}  // namespace kiroku::archive
