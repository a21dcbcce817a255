#include "archive/case_reader.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/sample_case.h"

namespace kiroku::archive {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

class CaseReading : public ::testing::Test {
 protected:
  test::SampleArchive archive_;
  std::filesystem::path folder_ = test::SampleCase::write(archive_);
};

TEST_F(CaseReading, GivesSegmentsThatMeetASpan) {
  const CaseReader reader = CaseReader::open(folder_);
  const std::vector<SegmentEntry> found = reader.segments("endoscope", 2 * kSecond, 4 * kSecond + 1);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].index, 1U);
  EXPECT_EQ(found[1].index, 2U);
  EXPECT_EQ(reader.duration_ns(), 6 * kSecond);
  EXPECT_TRUE(reader.closing().has_value());
}

TEST_F(CaseReading, NamesTheStreamsThereAre) {
  const CaseReader reader = CaseReader::open(folder_);
  EXPECT_EQ(reader.stream("vitals").extension, "jsonl");
  try {
    static_cast<void>(reader.stream("room"));
    FAIL() << "a stream that is not there was found";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("endoscope, vitals"));
  }
}

TEST_F(CaseReading, ReadsTimesFromTheStartAndInUtc) {
  const CaseReader reader = CaseReader::open(folder_);
  EXPECT_EQ(reader.parse_time("00:00:02"), 2 * kSecond);
  EXPECT_EQ(reader.parse_time("01:02:03.5"), 3'723 * kSecond + kSecond / 2);
  EXPECT_EQ(reader.parse_time(format_utc(test::SampleArchive::opened_at() + std::chrono::seconds(3))),
            3 * kSecond);
  for (const char* wrong :
       {"", "2", "00:60:00", "00:00:60", "00:00:1", "00:00:01.", "-1:00:00", "00:00:01.1234567890"}) {
    EXPECT_THROW(static_cast<void>(reader.parse_time(wrong)), UsageError) << wrong;
  }
}

TEST_F(CaseReading, LeavesOutATornLastLine) {
  std::ofstream(folder_ / "ledger.jsonl", std::ios::app) << "{\"type\":";
  std::uint64_t entries = 0;
  CaseReader::open(folder_).for_each([&](const CaseEntry&) { ++entries; });
  EXPECT_EQ(entries, 11U);
}

TEST_F(CaseReading, RefusesAFolderThatIsNoCase) {
  EXPECT_THROW(CaseReader::open(archive_.folder()), UsageError);
  EXPECT_THROW(CaseReader::open(archive_.folder() / "nowhere"), UsageError);
}

}  // namespace
}  // namespace kiroku::archive
