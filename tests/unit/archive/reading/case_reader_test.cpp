#include "archive/reading/case_reader.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/verify/verifier.h"
#include "base/error.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/sample_case.h"

namespace kiroku::archive {
namespace {

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

TEST_F(CaseReading, StatesTheRootThatVerificationDoes) {
  const CaseReader before = CaseReader::open(folder_);
  EXPECT_EQ(before.lines_root(), verify_case(folder_, archive_.options()).lines_root);
  std::ofstream(folder_ / kLedgerFile, std::ios::app) << "half a line";
  EXPECT_EQ(CaseReader::open(folder_).lines_root(), before.lines_root());
  EXPECT_EQ(before.lines_root(), verify_case(folder_, archive_.options()).lines_root);
}

// Whoever asks for a case by its identifier would be shown another patient.
TEST_F(CaseReading, RefusesACaseInThePlaceOfAnother) {
  const std::string its_own = folder_.filename().string();
  const std::filesystem::path place = folder_.parent_path() / "20260101T000000Z-00000000";
  std::filesystem::copy(folder_, place, std::filesystem::copy_options::recursive);
  for (const std::filesystem::path& given : {place, place / "", place / "segments" / ".."}) {
    try {
      static_cast<void>(CaseReader::open(given));
      FAIL() << given << " was read";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), ::testing::HasSubstr("called by the identifier of case 20260101T000000Z-0"));
      EXPECT_THAT(error.what(), ::testing::HasSubstr("what lies in it is case " + its_own));
    }
  }
  const std::filesystem::path copy = folder_.parent_path() / "copy of it";
  std::filesystem::rename(place, copy);
  EXPECT_EQ(CaseReader::open(copy).opening().case_id, its_own);
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
       {"", "2x", "00:60:00", "00:00:60", "00:00:1", "00:00:01.", "-1:00:00", "00:00:01.1234567890"}) {
    EXPECT_THROW(static_cast<void>(reader.parse_time(wrong)), UsageError) << wrong;
  }
}

/// Six seconds of pictures; set by this much at 3 s.
CaseReader case_with_clock_set(test::SampleArchive& archive, std::int64_t step_ns) {
  archive.clear();
  archive.now_ns = 0;
  test::SampleCase sample(archive);
  archive.now_ns = 3 * kSecond;
  sample.writer().append({sample.segment(0, 0, {0, 3 * kSecond})}, archive.now());
  sample.writer().append({ClockEntry{true, 0, 0, step_ns}}, archive.now());
  archive.now_ns = 6 * kSecond;
  sample.writer().append({sample.segment(0, 1, {3 * kSecond, 6 * kSecond})}, archive.now());
  sample.close();
  return CaseReader::open(sample.folder());
}

std::string utc_after(int seconds) {
  return format_utc(test::SampleArchive::opened_at() + std::chrono::seconds(seconds));
}

std::string refusal_of(const CaseReader& reader, const std::string& time) {
  try {
    return "read as " + std::to_string(reader.parse_time(time, "--from"));
  } catch (const UsageError& error) {
    return error.what();
  }
}

TEST_F(CaseReading, ReadsUtcAsAClockShowedItThatWasSetForward) {
  const CaseReader reader = case_with_clock_set(archive_, 3600 * kSecond);
  EXPECT_EQ(reader.parse_time(utc_after(2)), 2 * kSecond);
  EXPECT_EQ(reader.parse_time(utc_after(3604)), 4 * kSecond);
  EXPECT_EQ(reader.parse_time(utc_after(3603)), 3 * kSecond);
  EXPECT_EQ(refusal_of(reader, utc_after(4)),
            "--from is " + utc_after(4) + ", which the recorder's clock never showed: it was set from " +
                utc_after(3) + " to " + utc_after(3603) +
                " at 00:00:03 of the case; write the time from the start of the case, such as 00:00:03");
  EXPECT_EQ(reader.wall_clock().at(4 * kSecond), *parse_utc(utc_after(3604)));
}

TEST_F(CaseReading, RefusesUtcThatAClockShowedTwice) {
  const CaseReader reader = case_with_clock_set(archive_, -2 * kSecond);
  EXPECT_EQ(refusal_of(reader, utc_after(2)),
            "--from is " + utc_after(2) +
                ", which the recorder's clock showed several times, since it was set back: at 00:00:02 and "
                "00:00:04 of the case; write which of them is meant, from the start of the case");
  EXPECT_EQ(reader.parse_time(utc_after(0)), 0);
  EXPECT_EQ(reader.parse_time(utc_after(4)), 6 * kSecond);
  // By an hour back: the second time lies before the case, or behind it.
  const CaseReader hour = case_with_clock_set(archive_, -3600 * kSecond);
  EXPECT_EQ(hour.parse_time(utc_after(2)), 2 * kSecond);
  EXPECT_EQ(hour.parse_time(utc_after(-3600 + 4)), 4 * kSecond);
}

TEST_F(CaseReading, ReadsEveryFormOfATimeAndTellsThemWhereItIsNone) {
  const CaseReader reader = CaseReader::open(folder_);
  for (const char* text : {"5s", "0:05", "00:00:05", "5", "5000ms"}) {
    EXPECT_EQ(reader.parse_time(text), 5 * kSecond) << text;
  }
  try {
    static_cast<void>(reader.parse_time("noon", "--at"));
    FAIL() << "noon is a time";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), ::testing::StartsWith("--at is 'noon', which is no time: write 5s, 0:05, "
                                                    "1:02:03.5, 1h2m or 90 (seconds) from the start of the "
                                                    "case, or UTC such as 2"));
  }
}

TEST_F(CaseReading, TellsWhatIsWrongWithAStretch) {
  const CaseReader reader = CaseReader::open(folder_);
  const auto refusal = [&](const std::optional<std::string>& from, const std::optional<std::string>& to) {
    try {
      static_cast<void>(reader.parse_stretch(from, to));
    } catch (const UsageError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(refusal("4s", "0:02"), "--from (4s) is after --to (0:02): exchange the two");
  EXPECT_EQ(refusal("4s", "0:04"),
            "nothing lies between --from (4s) and --to (0:04), which are the same moment");
  EXPECT_EQ(refusal("1m", {}), "--from (1m) is beyond the end of the case, which is 00:00:06 long");
  EXPECT_EQ(refusal("6s", {}), "--from (6s) is beyond the end of the case, which is 00:00:06 long");
  EXPECT_EQ(refusal({}, "6.1"), "--to (6.1) is beyond the end of the case, which is 00:00:06 long");
  EXPECT_EQ(refusal({}, "0"),
            "nothing lies between --from (the start) and --to (0), which are the same moment");
  EXPECT_EQ(refusal("2400-01-01T00:00:00Z", {}),
            "--from (2400-01-01T00:00:00Z) is beyond the end of the case, which is 00:00:06 long");
  EXPECT_THAT(refusal({}, "9999-12-31T23:59:59Z"), ::testing::HasSubstr("is beyond the end of the case"));
  EXPECT_THAT(refusal("0001-01-01T00:00:00Z", {}), ::testing::HasSubstr("before the case begins"));
  const Span whole = reader.parse_stretch({}, {});
  EXPECT_EQ(whole.start_ns, 0);
  EXPECT_EQ(whole.end_ns, INT64_MAX);
  const Span some = reader.parse_stretch("2s", "0:06");
  EXPECT_EQ(some.start_ns, 2 * kSecond);
  EXPECT_EQ(some.end_ns, 6 * kSecond);
}

TEST_F(CaseReading, AsksWhichStreamWasMeant) {
  const CaseReader reader = CaseReader::open(folder_);
  try {
    static_cast<void>(reader.stream("endoscop"));
    FAIL() << "a stream that is not there was found";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), ::testing::EndsWith("it has endoscope, vitals (did you mean 'endoscope'?)"));
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
