#include "archive/format/line_reader.h"

#include <algorithm>
#include <fstream>
#include <span>
#include <utility>

#include <gtest/gtest.h>

#include "archive/format/case_folder.h"
#include "archive/format/ledger_entry.h"
#include "archive/format/limits.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

struct Seen {
  std::string text;
  std::uint64_t offset, bytes;
  bool too_long, torn;
  friend bool operator==(const Seen&, const Seen&) = default;
};

std::vector<Seen> lines_of(const std::string& text) {
  test::TemporaryFolder folder;
  std::ofstream(folder / "lines", std::ios::binary) << text;
  const CaseFolder opened = CaseFolder::open(folder.path());
  const FileOpening file = opened.open_file("lines");
  LineReader reader(*file.file);
  std::vector<Seen> all;
  for (LedgerLine line; reader.next(line);) {
    all.push_back({std::string(line.text), line.offset, line.bytes, line.too_long, line.torn});
  }
  return all;
}

TEST(LineReader, GivesLinesWithTheirOffsets) {
  EXPECT_EQ(
      lines_of("ab\n\nc\n"),
      (std::vector<Seen>{{"ab", 0, 2, false, false}, {"", 3, 0, false, false}, {"c", 4, 1, false, false}}));
}

TEST(LineReader, TellsATornLastLine) {
  EXPECT_EQ(lines_of("ab\ncd"), (std::vector<Seen>{{"ab", 0, 2, false, false}, {"cd", 3, 2, false, true}}));
}

TEST(LineReader, GivesNothingOfAnEmptyFile) { EXPECT_TRUE(lines_of("").empty()); }

TEST(LineReader, KeepsOnlyTheBeginningOfALineThatIsTooLong) {
  const std::string longest(kMaximumLineBytes, 'x');
  const std::vector<Seen> lines = lines_of(longest + "\n" + longest + "yz\nend\n");
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_FALSE(lines[0].too_long);
  EXPECT_EQ(lines[1], (Seen{longest, kMaximumLineBytes + 1, kMaximumLineBytes + 2, true, false}));
  EXPECT_EQ(lines[2], (Seen{"end", 2 * kMaximumLineBytes + 4, 3, false, false}));
}

/// So many lines that are holes but for their line feeds, and a line behind them.
class Holes final : public crypto::ByteSource {
 public:
  Holes(std::uint64_t lines, std::uint64_t bytes_of_line) : lines_(lines), line_(bytes_of_line + 1) {}
  [[nodiscard]] std::uint64_t size() const override { return lines_ * line_ + kEnd.size(); }
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> into) const override {
    const std::size_t done =
        offset < size() ? static_cast<std::size_t>(std::min<std::uint64_t>(into.size(), size() - offset)) : 0;
    std::ranges::fill(into.first(done), std::byte{0});
    for (std::uint64_t at = offset / line_ * line_ + line_ - 1; at < offset + done; at += line_)
      into[at - offset] = std::byte{'\n'};
    const std::uint64_t end = lines_ * line_;
    for (std::uint64_t at = std::max(offset, end); at < offset + done; ++at)
      into[at - offset] = static_cast<std::byte>(kEnd[at - end]);
    bytes_read += done;
    return done;
  }
  mutable std::uint64_t bytes_read = 0;

 private:
  static constexpr std::string_view kEnd = "end\n";
  std::uint64_t lines_, line_;
};

struct ReadThrough {
  std::uint64_t lines = 0;
  bool torn = false;
  std::string last;
};
ReadThrough read_through(const Holes& holes) {
  LineReader reader(holes);
  ReadThrough all;
  for (LedgerLine line; reader.next(line);) {
    ++all.lines;
    all.torn = line.torn;
    all.last = line.text;
  }
  return all;
}

TEST(LineReader, OfManyLinesThatAreTooLongReadsNoMoreThanOfOne) {
  const Holes holes(20, std::uint64_t{30} << 20U);
  const ReadThrough all = read_through(holes);
  EXPECT_EQ(all.lines, 3U);
  EXPECT_TRUE(all.torn);
  EXPECT_LT(holes.bytes_read, kMostBytesOfLine + kMaximumLineBytes);
}

TEST(LineReader, OfManyLinesOfZerosReadsNoMoreThanOfOne) {
  const Holes holes(200, kMaximumLineBytes);
  const ReadThrough all = read_through(holes);
  EXPECT_EQ(all.lines, 66U);
  EXPECT_TRUE(all.torn);
  EXPECT_LT(holes.bytes_read, kMostBytesOfLine + 2 * kMaximumLineBytes);
}

TEST(LineReader, GoesOnBehindAFewOfEither) {
  for (const auto& [lines, bytes] : {std::pair(2, 31U << 20U), std::pair(64, unsigned(kMaximumLineBytes))}) {
    const ReadThrough all = read_through({std::uint64_t(lines), bytes});
    EXPECT_EQ(all.lines, std::uint64_t(lines) + 1);
    EXPECT_FALSE(all.torn);
    EXPECT_EQ(all.last, "end");
  }
}

TEST(LineReader, TheFirstLineAloneIsReadNoFurtherThanALineGoes) {
  const auto first = [](const std::string& text) {
    const test::TemporaryFolder folder;
    std::ofstream(folder / "lines", std::ios::binary) << text;
    return first_whole_line(real_reading().open_to_read(folder / "lines"));
  };
  EXPECT_EQ(first("ab\ncd\n"), "ab");
  EXPECT_EQ(first("\n"), "");
  EXPECT_EQ(first(""), std::nullopt);
  EXPECT_EQ(first("ab"), std::nullopt);
  const std::string longest(kMaximumLineBytes, 'x');
  EXPECT_EQ(first(longest + "\n"), longest);
  EXPECT_EQ(first(longest + "x\n"), std::nullopt);
  const Holes holes(1, std::uint64_t{64} << 20U);
  EXPECT_EQ(first_whole_line(holes), std::nullopt);
  EXPECT_LE(holes.bytes_read, 4096U);
}

}  // namespace
}  // namespace kiroku::archive
