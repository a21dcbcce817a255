// The format page is what an expert reads in twenty years: it must know every finding there is.
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "archive/format/age_layout.h"
#include "archive/format/limits.h"
#include "archive/verify/finding_codes.h"
#include "tests/support/build_paths.h"

namespace kiroku::archive {
namespace {

TEST(FormatPage, ExplainsEveryFindingCode) {
  std::ifstream in(test::source_folder() / "docs/reference/format.md");
  ASSERT_TRUE(in);
  std::stringstream page;
  page << in.rdbuf();
  for (const FindingCode& code : kFindingCodes) {
    EXPECT_NE(page.str().find("| `" + std::string(code.name) + "` |"), std::string::npos) << code.name;
  }
}

/// "131,072".
std::string with_commas(std::uint64_t number) {
  std::string digits = std::to_string(number);
  for (std::size_t at = digits.size(); at > 3; at -= 3) {
    digits.insert(at - 3, ",");
  }
  return digits;
}

TEST(FormatPage, StatesEveryLimit) {
  std::ifstream in(test::source_folder() / "docs/reference/format.md");
  ASSERT_TRUE(in);
  std::stringstream page;
  page << in.rdbuf();
  const auto states = [&](const std::string& row) {
    return page.str().find("\n| " + row) != std::string::npos;
  };
  EXPECT_TRUE(states("a line of a ledger or of the log, without LF | " + with_commas(kMaximumLineBytes) +
                     " bytes |"));
  EXPECT_TRUE(states("values (texts, numbers, lists, objects) in one line | " +
                     with_commas(kMaximumJsonValues) + " |"));
  EXPECT_TRUE(states("streams that `open` names | " + with_commas(kMaximumStreams) + " |"));
  EXPECT_TRUE(states("digits of each number of `time_base` | " + with_commas(kMaximumTimeBaseDigits) + " |"));
  EXPECT_TRUE(states("`excerpt.json` | " + with_commas(kMaximumExcerptBytes) + " bytes, " +
                     with_commas(kMaximumJsonValues) + " values |"));
  EXPECT_TRUE(states("a checkpoint's file | " + with_commas(kMaximumNoteBytes) + " bytes, 100 signatures"));
  EXPECT_TRUE(states("a token's file | " + with_commas(kMaximumTokenBytes) + " bytes |"));
  EXPECT_TRUE(states("the original age header beside a re-keyed segment | " +
                     with_commas(kMaximumAgeHeaderBytes) + " bytes |"));
  EXPECT_TRUE(states("folders in folders that are entered | " + std::to_string(kMaximumFolderDepth) + " |"));
  EXPECT_TRUE(states("lines that are no entries | " + with_commas(kMostBrokenLines) + " |"));
  EXPECT_TRUE(states("findings of one code | " + with_commas(kMostFindingsOfOneCode) + " |"));
  EXPECT_TRUE(states("the text of a finding, and its file name, each | " + with_commas(kMaximumFindingText) +
                     " bytes |"));
  EXPECT_TRUE(states("all findings together | " + std::to_string(kMaximumFindingBytes >> 20U) + " MiB |"));
}

}  // namespace
}  // namespace kiroku::archive
