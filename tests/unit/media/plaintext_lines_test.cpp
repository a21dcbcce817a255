#include "media/plaintext_lines.h"

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::media {
namespace {

using Lines = std::vector<std::string>;

Lines lines_of(const std::string& text, std::size_t longest = 1U << 20, bool tolerate_cut = false) {
  const auto source = crypto::memory_source(bytes_of(text));
  Lines lines;
  for_each_line(*source, "table", longest, tolerate_cut, [&](std::uint64_t number, std::string_view line) {
    lines.emplace_back(line);
    EXPECT_EQ(number, lines.size());
  });
  return lines;
}

TEST(PlaintextLines, VisitsEachInOrder) {
  EXPECT_EQ(lines_of(""), Lines{});
  EXPECT_EQ(lines_of("\n"), Lines{""});
  EXPECT_EQ(lines_of("a\n\nb\r\n"), (Lines{"a", "", "b\r"}));
}

TEST(PlaintextLines, JoinsALineThatReadsCut) {
  const std::string longer_than_a_read(700'000, 'x');
  EXPECT_EQ(lines_of("a\n" + longer_than_a_read + "\nb\n"), (Lines{"a", longer_than_a_read, "b"}));
}

TEST(PlaintextLines, WantsALineEndUnlessToldOfACut) {
  EXPECT_THROW(lines_of("a\nb"), Error);
  EXPECT_EQ(lines_of("a\nb", 10, true), Lines{"a"});
}

TEST(PlaintextLines, RefusesALineThatIsTooLong) {
  EXPECT_EQ(lines_of("12345\n", 5), Lines{"12345"});
  EXPECT_THROW(lines_of("123456\n", 5), Error);
  EXPECT_THROW(lines_of("1\n123456", 5, true), Error);
}

}  // namespace
}  // namespace kiroku::media
