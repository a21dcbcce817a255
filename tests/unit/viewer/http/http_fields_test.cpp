#include "viewer/http/http_fields.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::viewer {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

TEST(Target, IsSplitIntoDecodedSegmentsAndFields) {
  const auto target = parse_target("/api/cases/a%20b?search=two+words&limit=5&empty=&bare&search=%E6%89%8B");
  ASSERT_TRUE(target);
  EXPECT_THAT(target->segments, ElementsAre("api", "cases", "a b"));
  EXPECT_THAT(target->query, ElementsAre(Pair("search", "two words"), Pair("limit", "5"), Pair("empty", ""),
                                         Pair("bare", ""), Pair("search", "手")));
  EXPECT_THAT(parse_target("/")->segments, IsEmpty());
  EXPECT_THAT(parse_target("/?x=1")->segments, IsEmpty());
}

class RefusedTarget : public testing::TestWithParam<std::string> {};
TEST_P(RefusedTarget, IsNoAddress) { EXPECT_FALSE(parse_target(GetParam())) << GetParam(); }
INSTANTIATE_TEST_SUITE_P(Forms, RefusedTarget,
                         testing::Values("", "api", "https://host/api", "*", "/..", "/../etc/passwd",
                                         "/a/../b", "/a/./b", "//etc", "/a//b", "/a/", "/%2e%2e/x",
                                         "/%2E%2E/x", "/a%2fb", "/a%5cb", "/a\\b", "/a%00b", "/a%0d%0ab",
                                         "/a%7f", "/%", "/%4", "/%zz", "/%c0%ae%c0%ae", "/%ff", "/a?x=%",
                                         "/a?%ff=1", "/a?x=%00", "/a?x=or-1%00y", "/a?%00=1",
                                         "/1/2/3/4/5/6/7/8/9/10/11/12/13/14/15/16/17"));

TEST(Target, TakesALimitedNumberOfFields) {
  std::string many = "/a?";
  for (int i = 0; i < 33; ++i) many += "x=1&";
  EXPECT_FALSE(parse_target(many));
}

TEST(Cookie, IsFoundByItsExactName) {
  EXPECT_EQ(cookie_value("a=1; __Host-kiroku=t-o_k; b=2", "__Host-kiroku"), "t-o_k");
  EXPECT_EQ(cookie_value("x__Host-kiroku=1", "__Host-kiroku"), std::nullopt);
  EXPECT_EQ(cookie_value("__host-kiroku=1", "__Host-kiroku"), std::nullopt);
  EXPECT_EQ(cookie_value("", "__Host-kiroku"), std::nullopt);
}

TEST(Cookie, ThatStandsTwiceIsNone) {
  EXPECT_EQ(cookie_value("__Host-kiroku=mine; __Host-kiroku=theirs", "__Host-kiroku"), std::nullopt);
}

struct RangeCase {
  std::string field;
  RangeRequest::Kind kind;
  std::uint64_t first = 0, last = 0;
};
class Range : public testing::TestWithParam<RangeCase> {};
TEST_P(Range, OfAThousandBytes) {
  const RangeRequest range = parse_range(GetParam().field, 1000);
  ASSERT_EQ(range.kind, GetParam().kind) << GetParam().field;
  if (range.kind == RangeRequest::Kind::kPart) {
    EXPECT_EQ(range.range.first, GetParam().first);
    EXPECT_EQ(range.range.last, GetParam().last);
  }
}
using Kind = RangeRequest::Kind;
INSTANTIATE_TEST_SUITE_P(
    Fields, Range,
    testing::Values(RangeCase{"bytes=0-0", Kind::kPart, 0, 0}, RangeCase{"bytes=0-499", Kind::kPart, 0, 499},
                    RangeCase{"bytes=500-", Kind::kPart, 500, 999},
                    RangeCase{"bytes=500-5000", Kind::kPart, 500, 999},
                    RangeCase{"bytes=-1", Kind::kPart, 999, 999},
                    RangeCase{"bytes=-5000", Kind::kPart, 0, 999}, RangeCase{"BYTES=1-2", Kind::kPart, 1, 2},
                    RangeCase{"bytes=1000-", Kind::kUnsatisfiable},
                    RangeCase{"bytes=-0", Kind::kUnsatisfiable},
                    RangeCase{"bytes=18446744073709551615-", Kind::kUnsatisfiable},
                    RangeCase{"bytes=18446744073709551616-", Kind::kWhole},
                    RangeCase{"bytes=2-1", Kind::kWhole}, RangeCase{"bytes=", Kind::kWhole},
                    RangeCase{"bytes=-", Kind::kWhole}, RangeCase{"bytes=a-b", Kind::kWhole},
                    RangeCase{"bytes=+1-2", Kind::kWhole}, RangeCase{"bytes=0-1,5-6", Kind::kWhole},
                    RangeCase{"lines=0-1", Kind::kWhole}, RangeCase{"", Kind::kWhole}));

TEST(Range, OfNothingCannotBeSatisfied) {
  EXPECT_EQ(parse_range("bytes=0-", 0).kind, Kind::kUnsatisfiable);
  EXPECT_EQ(parse_range("bytes=-5", 0).kind, Kind::kUnsatisfiable);
}

TEST(Accept, EncodingsWithTheirWeights) {
  EXPECT_TRUE(accepts_encoding("gzip, br;q=0.5", "br"));
  EXPECT_TRUE(accepts_encoding("GZIP", "gzip"));
  EXPECT_FALSE(accepts_encoding("gzip;q=0", "gzip"));
  EXPECT_FALSE(accepts_encoding("gzip;q=0.000", "gzip"));
  EXPECT_FALSE(accepts_encoding("gzip;q=nonsense", "gzip"));
  EXPECT_FALSE(accepts_encoding("*", "br"));
  EXPECT_FALSE(accepts_encoding("", "br"));
}

TEST(Accept, LanguageIsEnglishUnlessJapaneseIsPreferred) {
  EXPECT_EQ(preferred_language("ja,en;q=0.8"), "ja");
  EXPECT_EQ(preferred_language("ja-JP"), "ja");
  EXPECT_EQ(preferred_language("en-GB,ja;q=0.9"), "en");
  EXPECT_EQ(preferred_language("de,fr;q=0.5"), "en");
  EXPECT_EQ(preferred_language(""), "en");
}

TEST(EntityTag, IsComparedWeakly) {
  EXPECT_TRUE(names_entity_tag("\"a\", W/\"b\"", "\"b\""));
  EXPECT_TRUE(names_entity_tag("*", "\"b\""));
  EXPECT_FALSE(names_entity_tag("\"a\"", "\"b\""));
  EXPECT_FALSE(names_entity_tag("", "\"b\""));
}

}  // namespace
}  // namespace kiroku::viewer
