#include "base/csv_field.h"

#include <gtest/gtest.h>

namespace kiroku {
namespace {

TEST(CsvField, IsQuotedWhereItHasToBe) {
  EXPECT_EQ(csv_field("HR"), "HR");
  EXPECT_EQ(csv_field(""), "");
  EXPECT_EQ(csv_field("a,b"), "\"a,b\"");
  EXPECT_EQ(csv_field("say \"b\""), "\"say \"\"b\"\"\"");
  EXPECT_EQ(csv_field("µmol/L 血圧"), "µmol/L 血圧");
}

TEST(CsvField, IsNoFormulaOfASpreadsheet) {
  for (const char* const formula : {"=1+1", "+1", "-1", "@SUM(A1)", "＝1+1", "＋1", "－1", "＠SUM(A1)"})
    EXPECT_EQ(csv_field(formula), std::string("'") + formula);
  EXPECT_EQ(csv_field("=HYPERLINK(\"http://x\",A1)"), "\"'=HYPERLINK(\"\"http://x\"\",A1)\"");
  EXPECT_EQ(csv_field("a=b"), "a=b");
  EXPECT_EQ(csv_field("x;=1+1;＠A1; y"), "x;'=1+1;'＠A1; y") << "where a semicolon begins the next cell";
}

TEST(CsvField, ShowsWhatATerminalWouldObey) {
  EXPECT_EQ(csv_field("a\x1b[2Jb"), "a\\u{001B}[2Jb");
  EXPECT_EQ(csv_field("\u202e51"), "\\u{202E}51");
  EXPECT_EQ(csv_field("two\r\nlines"), "two\\u{000D} lines");
  EXPECT_EQ(csv_field("\t=1"), " =1");
}

}  // namespace
}  // namespace kiroku
