#include "base/printable.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku {
namespace {

struct Example {
  std::string text, shown;
};

// What a person would obey or not see.
const Example kMisleading[] = {
    {std::string("\0", 1), "\\u{0000}"},
    {"\x07", "\\u{0007}"},
    {"\r", "\\u{000D}"},
    {"\x1b[2J", "\\u{001B}[2J"},
    {"\x7f", "\\u{007F}"},
    {"\u0085", "\\u{0085}"},
    {"\u009b2J", "\\u{009B}2J"},
    {"\u00ad", "\\u{00AD}"},
    {"\u034f", "\\u{034F}"},
    {"\u061c", "\\u{061C}"},
    {"\u180e", "\\u{180E}"},
    {"an\u200bna", "an\\u{200B}na"},
    {"\u200c", "\\u{200C}"},
    {"\u200d", "\\u{200D}"},
    {"\u200e", "\\u{200E}"},
    {"\u200f", "\\u{200F}"},
    {"\u2028", "\\u{2028}"},
    {"\u2029", "\\u{2029}"},
    {"\u202a", "\\u{202A}"},
    {"\u202b", "\\u{202B}"},
    {"\u202c", "\\u{202C}"},
    {"\u202d", "\\u{202D}"},
    {"x\u202egpj.exe", "x\\u{202E}gpj.exe"},
    {"\u2060", "\\u{2060}"},
    {"\u2066", "\\u{2066}"},
    {"\u2067", "\\u{2067}"},
    {"\u2068", "\\u{2068}"},
    {"\u2069", "\\u{2069}"},
    {"\u3164", "\\u{3164}"},
    {"\u2800", "\\u{2800}"},
    // selectors of variants of what has none
    {"an\ufe00na", "an\\u{FE00}na"},
    {"\ufe0f", "\\u{FE0F}"},
    {"anna\U000e0100", "anna\\u{E0100}"},
    {"葛\U000e0100\U000e0101城", "葛\U000e0100\\u{E0101}城"},
    {"❤\U000e0100", "❤\\u{E0100}"},
    {"\ufeff", "\\u{FEFF}"},
    {"\uffa0", "\\u{FFA0}"},
    {"\ufff9", "\\u{FFF9}"},
    {"\uffff", "\\u{FFFF}"},
    {"\U0001fffe", "\\u{1FFFE}"},
    {"\U000e0041", "\\u{E0041}"},
    // no UTF-8: a lone continuation, cut short, too long a form, a surrogate, beyond the last character
    {"\xff", "\\x{FF}"},
    {"\x80", "\\x{80}"},
    {"\xc3(", "\\x{C3}("},
    {"\xe3\x81", "\\x{E3}\\x{81}"},
    {"\xc0\xaf", "\\x{C0}\\x{AF}"},
    {"\xe0\x80\xaf", "\\x{E0}\\x{80}\\x{AF}"},
    {"\xed\xa0\x80", "\\x{ED}\\x{A0}\\x{80}"},
    {"\xf4\x90\x80\x80", "\\x{F4}\\x{90}\\x{80}\\x{80}"},
};

const std::string kHarmless[] = {
    "",
    "endoscope",
    "a + b = \"c\" \\ {d}",
    "佐藤 恵子",
    "葛\U000e0100城",  // a Japanese name with the selector of its variant
    "ﾊﾝｶｸ・全角　空白",
    "Zoë, A\u030angstro\u0308m",  // accents that combine
    "אורתופדיה",
    "جراحة",
    "Ελλάδα, Москва, 서울",
    "clip ✓ \U0001f600 ❤\ufe0f",
    "神\ufe00",
    "1\u00a0234,5\u202fµm ½ € ‰ – “quoted”",
    "\ufffd",  // what stands for a character that was lost
};

TEST(Printable, ShowsWhatWouldBeObeyedOrUnseen) {
  for (const Example& example : kMisleading) {
    EXPECT_EQ(printable(example.text), example.shown);
    EXPECT_TRUE(first_unprintable(example.text)) << example.shown;
    EXPECT_EQ(first_unprintable(printable(example.text)), std::nullopt) << example.shown;
  }
}

TEST(Printable, LeavesEveryScriptAsItIs) {
  for (const std::string& text : kHarmless) {
    EXPECT_EQ(printable(text), text);
    EXPECT_EQ(first_unprintable(text), std::nullopt) << text;
    EXPECT_EQ(printable_json(text), text);
  }
}

TEST(Printable, IsOneLine) {
  EXPECT_EQ(printable("a\nb\tc"), "a b c");
  EXPECT_EQ(first_unprintable("a\nb"), "\\u{000A}");
  EXPECT_EQ(first_unprintable("a\tb"), "\\u{0009}");
}

TEST(Printable, NamesTheFirstOfSeveral) { EXPECT_EQ(first_unprintable("a\u2066b\u202e"), "\\u{2066}"); }

TEST(Printable, IsToldWhereAPersonWritesIt) {
  EXPECT_NO_THROW(require_printable("佐藤 恵子", "the guest's name"));
  EXPECT_THAT([] { require_printable("anna\u200b", "the guest's name"); },
              testing::ThrowsMessage<UsageError>(testing::StartsWith(
                  "the guest's name holds \\u{200B}, which is obeyed or cannot be seen")));
}

TEST(Printable, EndsNoQuotation) {
  EXPECT_EQ(in_quotation_marks("30 days"), "\"30 days\"");
  EXPECT_EQ(in_quotation_marks("x\". The verifier \u201clooked\u201d \uff02"),
            "\"x\\u{0022}. The verifier \\u{201C}looked\\u{201D} \\u{FF02}\"");
  EXPECT_EQ(in_quotation_marks("「院内規程」, l'été"), "\"「院内規程」, l'été\"");
  EXPECT_EQ(without_quotation_marks("x」、検証者は“y”"), "x\\u{300D}、検証者は\\u{201C}y\\u{201D}");
  EXPECT_EQ(in_quotation_marks("\xff\""), "\"\xff\\u{0022}\"");
}

TEST(PrintableJson, EscapesSoThatEveryReaderStillReadsTheSame) {
  EXPECT_EQ(printable_json("{\n  \"a\": \"x\u202e\u009b\x7f\u2028\"\n}"),
            "{\n  \"a\": \"x\\u202e\\u009b\\u007f\\u2028\"\n}");
  EXPECT_EQ(printable_json("\"\U000e0041\""), "\"\\udb40\\udc41\"");
}

}  // namespace
}  // namespace kiroku
