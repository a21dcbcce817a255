#include "archive/format/case_layout.h"

#include <gtest/gtest.h>

namespace kiroku::archive {
namespace {

TEST(CaseLayout, NumbersHaveEightDigitsAndGrowBeyond) {
  EXPECT_EQ(format_index(0), "00000000");
  EXPECT_EQ(format_index(99'999'999), "99999999");
  EXPECT_EQ(format_index(100'000'000), "100000000");
  EXPECT_EQ(parse_index("00000042"), 42U);
  EXPECT_EQ(parse_index("100000000"), 100'000'000U);
}

TEST(CaseLayout, RefusesNumbersThatAreWrittenOtherwise) {
  for (const char* text : {"", "42", "000000042", "0000004x", "-0000042", "+0000042", " 0000042", "0000042 ",
                           "99999999999999999999999"}) {
    EXPECT_EQ(parse_index(text), std::nullopt) << text;
  }
}

TEST(CaseLayout, NamesFilesAsTheFormatSays) {
  EXPECT_EQ(note_path(42), "checkpoints/00000042.note");
  EXPECT_EQ(token_path(42, "swiss"), "tokens/00000042.swiss.tsr");
  EXPECT_EQ(token_path(42, "swiss", TokenForm::kShared), "tokens/00000042.swiss.ers");
  EXPECT_EQ(segment_path("endoscope", 7, "ts"), "segments/endoscope/00000007.ts.age");
}

TEST(CaseLayout, ReadsNamesBack) {
  EXPECT_EQ(size_of_note_name("00000042.note"), 42U);
  EXPECT_EQ(size_of_note_name("00000042.note.part"), std::nullopt);
  EXPECT_EQ(size_of_note_name("42.note"), std::nullopt);
  const auto token = parse_token_name("00000042.swiss.tsr");
  ASSERT_TRUE(token.has_value());
  EXPECT_EQ(token->size, 42U);
  EXPECT_EQ(token->authority, "swiss");
  EXPECT_EQ(token->form, TokenForm::kResponse);
  const auto shared = parse_token_name("00000042.swiss.ers");
  ASSERT_TRUE(shared.has_value());
  EXPECT_EQ(shared->size, 42U);
  EXPECT_EQ(shared->authority, "swiss");
  EXPECT_EQ(shared->form, TokenForm::kShared);
  for (const char* name : {"00000042.tsr", "00000042..tsr", "00000042.Swiss.tsr", "00000042.a.b.tsr",
                           "x.swiss.tsr", ".tsr", "00000042.ers", "00000042.swiss.ers.tsr"}) {
    EXPECT_FALSE(parse_token_name(name).has_value()) << name;
  }
}

TEST(CaseLayout, ShortNamesAreSafeFileNames) {
  EXPECT_TRUE(is_short_name("endoscope-2"));
  EXPECT_TRUE(is_short_name("4k"));
  for (const char* name :
       {"", "-a", "..", "a/b", "Endoscope", "a.b", "a b", "123456789012345678901234567890123"}) {
    EXPECT_FALSE(is_short_name(name)) << name;
  }
}

TEST(CaseLayout, CaseIdentifiers) {
  EXPECT_TRUE(is_case_id("20260805T091502Z-3f9c21ab"));
  for (const char* id : {"20260805T091502Z-3F9C21AB", "20260805T091502Z", "20260805t091502Z-3f9c21ab",
                         "../etc/passwd", "log"}) {
    EXPECT_FALSE(is_case_id(id)) << id;
  }
}

}  // namespace
}  // namespace kiroku::archive
