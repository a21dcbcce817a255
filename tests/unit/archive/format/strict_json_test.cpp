#include "archive/format/strict_json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::archive {
namespace {

using std::string_literals::operator""s;

struct Refusal {
  std::string name;
  std::string text;
  std::string problem;
};

class StrictJsonRefuses : public ::testing::TestWithParam<Refusal> {};

TEST_P(StrictJsonRefuses, WithPositionAndReason) {
  const JsonParse parse = parse_json(GetParam().text, {200, 4});
  EXPECT_FALSE(parse.value.has_value());
  EXPECT_EQ(parse.problem, GetParam().problem);
}

INSTANTIATE_TEST_SUITE_P(
    Texts, StrictJsonRefuses,
    ::testing::Values(
        Refusal{"Nothing", "", "byte 0: this is not JSON"},
        Refusal{"Nul", "{\"a\":\"x\0\"}"s, "byte 7: NUL is not allowed"},
        Refusal{"EscapedNul", R"({"a":"x\u0000"})", "byte 13: a text contains NUL"},
        Refusal{"EscapedNulInKey", R"({"\u0000":1})", "byte 8: a key contains NUL"},
        Refusal{"CarriageReturn", "{\"a\":1}\r", "byte 7: a control character is not allowed"},
        Refusal{"Tab", "{\t}", "byte 1: a control character is not allowed"},
        Refusal{"LineFeed", "{\n}", "byte 1: a control character is not allowed"},
        Refusal{"ByteOrderMark", "\xEF\xBB\xBF{}", "byte 0: a byte order mark is not allowed"},
        Refusal{"OverlongUtf8", "{\"a\":\"\xC0\x80\"}", "byte 6: this is not UTF-8"},
        Refusal{"Surrogate", "{\"a\":\"\xED\xA0\x80\"}", "byte 6: this is not UTF-8"},
        Refusal{"AboveUnicode", "{\"a\":\"\xF4\x90\x80\x80\"}", "byte 6: this is not UTF-8"},
        Refusal{"CutUtf8", "\"\xE2\x82", "byte 1: this is not UTF-8"},
        Refusal{"LoneEscapedSurrogate", R"("\ud800")", "byte 7: this is not JSON"},
        Refusal{"DuplicateKey", R"({"a":1,"a":2})", "byte 9: the key \"a\" stands twice"},
        Refusal{"DuplicateKeyByEscape", R"({"a":1,"\u0061":2})", "byte 14: the key \"a\" stands twice"},
        Refusal{"TooDeep", "[[[[[1]]]]]", "byte 4: nesting is deeper than 4 levels"},
        Refusal{"TwoTo53", "[9007199254740992]", "byte 17: a number is not below 2^53"},
        Refusal{"MinusTwoTo53", "[-9007199254740992]", "byte 18: a number is not above -2^53"},
        Refusal{"BeyondSixtyFourBits", "[99999999999999999999]",
                "byte 21: a number is not below 2^53 in magnitude"},
        Refusal{"Fraction", "[1.5]", "byte 4: a number is not a plain integer"},
        Refusal{"Exponent", "[1e3]", "byte 4: a number is not a plain integer"},
        Refusal{"NotANumber", "[NaN]", "byte 1: this is not JSON"},
        Refusal{"Null", "[null]", "byte 4: null is not allowed"},
        Refusal{"LeadingZero", "[01]", "byte 3: this is not JSON"},
        Refusal{"Comment", "{}//", "byte 2: this is not JSON"},
        Refusal{"TrailingText", "{}{}", "byte 2: this is not JSON"},
        Refusal{"CutShort", R"({"a":1)", "byte 5: this is not JSON"},
        Refusal{"TooLong", std::string(201, ' '), "byte 200: the text is longer than 200 bytes"}),
    [](const auto& tested) { return tested.param.name; });

TEST(StrictJson, RefusesNestingOfAMillionLevelsWithoutRecursion) {
  const std::string deep(1'000'000, '[');
  EXPECT_EQ(parse_json(deep, {1U << 20U, 4}).problem, "byte 4: nesting is deeper than 4 levels");
}

TEST(StrictJson, RefusesMoreValuesThanAllowed) {
  // A text, a list, a number and an object are a value each, and so is what holds them.
  EXPECT_TRUE(parse_json(R"({"a":"x","b":[1,{}]})", {200, 4, 5}).value);
  EXPECT_EQ(parse_json(R"({"a":"x","b":[1,{}]})", {200, 4, 4}).problem,
            "byte 19: there are more than 4 values");
  std::string list = "[";
  for (std::size_t i = 0; i < kMaximumJsonValues; ++i) {
    list += i > 0 ? ",1" : "1";
  }
  EXPECT_THAT(parse_json(list + "]").problem, testing::EndsWith("there are more than 131072 values"));
}

TEST(StrictJson, ReadsTheLargestIntegersAllowed) {
  const JsonParse parse = parse_json(R"({"high":9007199254740991,"low":-9007199254740991})");
  ASSERT_TRUE(parse.value.has_value()) << parse.problem;
  std::string problem;
  JsonFields fields(*parse.value, "entry", problem);
  EXPECT_EQ(fields.integer("high"), 9007199254740991);
  EXPECT_EQ(fields.integer("low"), -9007199254740991);
  fields.no_more();
  EXPECT_EQ(problem, "");
}

/// A blank leads past the reader of what programs write.
TEST(StrictJson, ReadsWhatProgramsWriteAsItReadsAllElse) {
  const std::string digits(15, '9');
  for (const std::string& text :
       {R"({"type":"segment","seq":17,"complete":true,"erased":false,"sha256":"ab"})"s,
        R"({"a":[],"b":{},"c":[1,"x",[true]],"":""})"s, R"([{"a":1},{"a":1}])"s, R"("text")"s, "true"s, "0"s,
        R"([0,-1,9007199254740991,-9007199254740991,)" + digits + "]", "[-0]"s, R"({"é":"患者 x"})"s,
        R"({"a":"\u0061\n\"","b":"\\"})"s, "{\"a\":\"\x7F\"}"s}) {
    const JsonParse parse = parse_json(text), other = parse_json(" " + text);
    ASSERT_TRUE(parse.value.has_value()) << text << ": " << parse.problem;
    EXPECT_TRUE(parse.value == other.value) << text;
  }
  for (const std::string& text : {R"({"a":1,"a":2})"s,
                                  R"({"a":1,})"s,
                                  R"({"a"})"s,
                                  R"({"a":01})"s,
                                  R"({"a":-})"s,
                                  R"({"a":1.5})"s,
                                  R"({"a":1e3})"s,
                                  R"({"a":null})"s,
                                  R"({a:1})"s,
                                  R"(["x)"s,
                                  R"(["x\)"s,
                                  "[1"s,
                                  "[1,"s,
                                  "[,1]"s,
                                  "[]]"s,
                                  "[tru]"s,
                                  "[truefalse]"s,
                                  "-"s,
                                  R"([1"x"])"s,
                                  "{]"s,
                                  "[}"s,
                                  "[9007199254740992]"s,
                                  "[[[[[1]]]]]"s}) {
    EXPECT_FALSE(parse_json(text).value.has_value()) << text;
    EXPECT_FALSE(parse_json(" " + text).value.has_value()) << text;
  }
}

std::string problem_of(const std::string& json, const std::function<void(JsonFields&)>& read) {
  const JsonParse parse = parse_json(json);
  EXPECT_TRUE(parse.value.has_value()) << parse.problem;
  std::string problem;
  JsonFields fields(*parse.value, "entry", problem);
  read(fields);
  return problem;
}

TEST(JsonFields, NamesAMissingKey) {
  EXPECT_EQ(problem_of("{}", [](JsonFields& f) { f.text("a"); }), "entry: \"a\" is missing");
}

TEST(JsonFields, NamesAKeyOfAnotherType) {
  EXPECT_EQ(problem_of(R"({"a":"1"})", [](JsonFields& f) { f.integer("a"); }),
            "entry: \"a\" is not an integer");
  EXPECT_EQ(problem_of(R"({"a":1})", [](JsonFields& f) { f.flag("a"); }),
            "entry: \"a\" is not true or false");
}

TEST(JsonFields, NamesAnUnknownKey) {
  EXPECT_EQ(problem_of(R"({"a":"x","b":1})",
                       [](JsonFields& f) {
                         f.text("a");
                         f.no_more();
                       }),
            "entry: \"b\" is not known here");
}

TEST(JsonFields, NamesThePlaceInsideNestedValues) {
  EXPECT_EQ(problem_of(R"({"list":[{"n":1},{"n":-2}]})",
                       [](JsonFields& f) {
                         for (JsonFields& item : f.objects("list")) {
                           item.count("n");
                         }
                       }),
            "list[1]: \"n\" is negative");
  EXPECT_EQ(problem_of("[]", [](JsonFields& f) { f.text("a"); }), "entry is not an object");
}

TEST(JsonFields, KeepsTheFirstProblem) {
  EXPECT_EQ(problem_of("{}",
                       [](JsonFields& f) {
                         f.text("first");
                         f.text("second");
                         f.no_more();
                       }),
            "entry: \"first\" is missing");
}

TEST(JsonFields, TakesOnlyLowerCaseHashesAndCanonicalTimes) {
  const std::string upper(64, 'A');
  EXPECT_THAT(problem_of("{\"h\":\"" + upper + "\"}", [](JsonFields& f) { f.digest("h"); }),
              ::testing::HasSubstr("64 lower-case hex digits"));
  for (const char* time :
       {"2026-08-05T09:15:02Z", "2026-08-05T09:15:02.12345Z", "2026-08-05T09:15:02.1234567Z",
        "2026-02-30T09:15:02.000123Z", "2026-08-05T24:15:02.000123Z", "2026-08-05T09:15:02.000123z",
        "2026-08-05 09:15:02.000123Z", "2026-08-05T09:15:02.00012 Z"}) {
    EXPECT_THAT(problem_of(std::string(R"({"t":")") + time + R"("})", [](JsonFields& f) { f.utc("t"); }),
                ::testing::HasSubstr("is not a UTC time such as"))
        << time;
  }
  EXPECT_EQ(problem_of(R"({"t":"2026-08-05T09:15:02.000123Z"})", [](JsonFields& f) { f.utc("t"); }), "");
}

}  // namespace
}  // namespace kiroku::archive
