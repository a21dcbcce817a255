#include "archive/search/search_words.h"

#include <gtest/gtest.h>

namespace kiroku::search {
namespace {

TEST(SearchWords, AreTheSameHoweverTheyAreTyped) {
  for (const char* number :
       {"0012345", "12345", " 12345 ", "00 123 45", "１２３４５", "００12345", "12345\xE2\x80\x8B",
        "\xC2\xA0"
        "12345"})
    EXPECT_EQ(normal_number(number), "12345") << number;
  for (const char* code : {"K653", "k653", "Ｋ６５３", "K 653", "ｋ653"})
    EXPECT_EQ(normal_word(code), "k653") << code;
  for (const char* code : {"5-511.11", "５－５１１．１１",
                           "5\xE2\x80\x90"
                           "511.11",
                           "5\xE2\x88\x92"
                           "511.11"})
    EXPECT_EQ(normal_word(code), "5-511.11") << code;
  // Composed or not.
  EXPECT_EQ(normal_word("e\xCC\x81"), normal_word("\xC3\x89"));
}

TEST(SearchWords, KeepWhatTellsTwoApart) {
  EXPECT_EQ(normal_word("0066"), "0066") << "a code's zeros are part of it";
  EXPECT_EQ(normal_number("A0012"), "a0012");
  EXPECT_NE(normal_number("12-345"), normal_number("12345"));
  EXPECT_EQ(normal_number("患者 0012"), "患者0012");
}

TEST(SearchWords, OfNothingAreNone) {
  for (const std::string& text : {std::string(), std::string("   "), std::string("000"),
                                  std::string("\xFF\xFE"), std::string("12\0003", 4), std::string(257, '7')})
    EXPECT_EQ(normal_number(text), "") << text;
  EXPECT_EQ(normal_number(std::string(256, '7')), std::string(256, '7'));
}

TEST(SearchWords, AreThoseOfTheSubject) {
  const auto words = words_of_subject(bytes_of(
      R"({"patient":{"id":"0012345","id_issuer":"Northern Hospital","name":"Yamada"},"procedure":{"code":"K653","coding_system":"JP"}})"));
  EXPECT_EQ(words, (SearchWords{"12345", "northernhospital", "k653", "jp"}));
  EXPECT_EQ(words_of_subject(bytes_of(R"({"patient":{"id":12345}})")), (SearchWords{"12345", "", "", ""}));
  // Without its number nobody gave one.
  EXPECT_EQ(words_of_subject(bytes_of(R"({"patient":{"id_issuer":"H"},"procedure":{"coding_system":"JP"}})")),
            SearchWords{});
  for (const char* other : {"", "[]", "7", "{", R"({"patient":"Yamada","procedure":"EMR"})",
                            R"({"patient":{"id":["1"]},"procedure":{"code":{}}})"})
    EXPECT_TRUE(words_of_subject(bytes_of(other)).empty()) << other;
  std::string deep = R"({"patient":{"id":"1"},"a":)" + std::string(100'000, '[');
  EXPECT_TRUE(words_of_subject(bytes_of(deep)).empty());
}

}  // namespace
}  // namespace kiroku::search
