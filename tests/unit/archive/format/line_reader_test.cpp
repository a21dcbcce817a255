#include "archive/format/line_reader.h"

#include <fstream>

#include <gtest/gtest.h>

#include "archive/format/case_folder.h"
#include "archive/format/ledger_entry.h"
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

}  // namespace
}  // namespace kiroku::archive
