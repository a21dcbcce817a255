#include "recorder/vitals/csv_source.h"

#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "recorder/clock/case_clock.h"
#include "recorder/source/source_address.h"
#include "recorder/vitals/csv_reader.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

class CsvSourceTest : public testing::Test {
 protected:
  CaseClock clock_;

  std::unique_ptr<VitalSource> open(const std::string& table, const std::string& options = "") {
    std::ofstream(path_, std::ios::binary) << table;
    return open_vital_source(parse_source_address(path_.string() + options), clock_);
  }
  std::vector<VitalSample> read(const std::string& table, const std::string& options = "") {
    const auto source = open(table, options);
    std::vector<VitalSample> samples;
    while (auto line = source->next()) {
      samples.push_back(std::get<VitalSample>(*line));
    }
    return samples;
  }
  /// The sentence after "cannot read <path>: ", "" if the table is read to its end.
  std::string refusal(const std::string& table, const std::string& options = "") {
    try {
      read(table, options);
    } catch (const Error& error) {
      const std::string start = "cannot read " + path_.string() + ": ";
      const std::string text = error.what();
      return text.starts_with(start) ? text.substr(start.size()) : text;
    }
    return "";
  }

  test::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_.path() / "ward.csv";
};

TEST_F(CsvSourceTest, ReadsSecondsCodesValuesAndUnits) {
  const auto samples = read(
      "time,code,value,unit\n"
      "0,MDC_PULS_OXIM_SAT_O2,97.5,%\n"
      "0.000000001,MDC_ECG_HEART_RATE,72,\n"
      "12.25,X_RAY_DOSE,-1e-3,mGy\n");
  ASSERT_EQ(samples.size(), 3U);
  EXPECT_EQ(to_json_line(samples[0]),
            R"({"time_ns":0,"code":"MDC_PULS_OXIM_SAT_O2","mdc":150456,"value":97.5,"unit":"%","source":"",)"
            R"("quality":"good"})");
  EXPECT_EQ(samples[1].time_ns, 1);
  EXPECT_EQ(samples[1].unit, "/min");
  EXPECT_EQ(samples[2].time_ns, 12'250'000'000);
  EXPECT_EQ(samples[2].mdc, 0U);
  EXPECT_EQ(samples[2].value, -0.001);
}

TEST_F(CsvSourceTest, TakesColumnsInAnyOrderQuotesByteOrderMarkAndWindowsLineEnds) {
  const auto samples = read(
      "\xEF\xBB\xBF\"Unit\",note,VALUE, Time ,code\r\n"
      "\"%\",\"said \"\"ok\"\",\r\nreally\",98,1.5,MDC_PULS_OXIM_SAT_O2\r\n"
      "\r\n"
      "%,, 99 ,1.5, HR \r\n"
      "%,,97,2,\"a, b\"");
  ASSERT_EQ(samples.size(), 3U);
  EXPECT_EQ(samples[0].value, 98);
  EXPECT_EQ(samples[0].time_ns, 1'500'000'000);
  EXPECT_EQ(samples[1].value, 99);
  EXPECT_EQ(samples[1].code, "HR");
  EXPECT_EQ(samples[2].code, "a, b");
}

TEST_F(CsvSourceTest, ReadsClockTimesFromTheStart) {
  const auto samples =
      read("time,code,value,unit\n00:00:02,A,1,1\n00:01:02.5,A,1,1\n101:00:00.000000001,A,1,1\n");
  ASSERT_EQ(samples.size(), 3U);
  EXPECT_EQ(samples[0].time_ns, 2'000'000'000);
  EXPECT_EQ(samples[1].time_ns, 62'500'000'000);
  EXPECT_EQ(samples[2].time_ns, 363'600'000'000'001);
}

TEST_F(CsvSourceTest, CountsTimesOfDayFromTheFirstRowWhenAsked) {
  const auto samples = read("time,code,value,unit\n09:15:02,A,1,1\n09:15:03.25,A,1,1\n", "?zero=first");
  ASSERT_EQ(samples.size(), 2U);
  EXPECT_EQ(samples[0].time_ns, 0);
  EXPECT_EQ(samples[1].time_ns, 1'250'000'000);
}

TEST_F(CsvSourceTest, CountsUtcTimesFromTheFirstRowAndKeepsThemAsDeviceTimes) {
  const auto samples =
      read("time,code,value,unit\n2026-08-05T23:59:59.5Z,A,1,1\n2026-08-06T00:00:00.000123Z,A,1,1\n");
  ASSERT_EQ(samples.size(), 2U);
  EXPECT_EQ(samples[0].time_ns, 0);
  EXPECT_EQ(samples[1].time_ns, 500'123'000);
  EXPECT_EQ(samples[1].device_time, parse_utc("2026-08-06T00:00:00.000123Z"));
}

TEST_F(CsvSourceTest, KeepsReportsWithoutValueAndStatedQuality) {
  const auto samples = read(
      "time,code,value,unit,quality\n"
      "0,A,,%,\n"
      "1,A,,%,missing\n"
      "2,A,5,%,invalid\n"
      "3,A,5,%,\n");
  ASSERT_EQ(samples.size(), 4U);
  EXPECT_FALSE(samples[0].value);
  EXPECT_EQ(samples[0].quality, media::VitalQuality::kMissing);
  EXPECT_EQ(samples[1].quality, media::VitalQuality::kMissing);
  EXPECT_EQ(samples[2].quality, media::VitalQuality::kInvalid);
  EXPECT_EQ(samples[3].quality, media::VitalQuality::kGood);
}

TEST_F(CsvSourceTest, NamesLineAndColumnOfWhatItCannotRead) {
  const std::string head = "time,code,value,unit\n";
  EXPECT_EQ(refusal(""), "it is empty; its first line must name the columns time,code,value,unit");
  EXPECT_EQ(refusal("time,code,unit\n"), "line 1 names no column value; it must name time,code,value,unit");
  EXPECT_EQ(refusal("0,HR,72,/min\n"), "line 1 names no column time; it must name time,code,value,unit");
  EXPECT_EQ(refusal("time,code,value,unit,Time\n"), "line 1 names the column time twice");
  EXPECT_EQ(refusal(head + "0,A,1,1\n\n1,A,abc,1\n"),
            "line 4, column value: 'abc' is not a number such as 97.5");
  EXPECT_EQ(refusal(head + "0,A,\"1,5\",1\n"), "line 2, column value: '1,5' is not a number such as 97.5");
  EXPECT_EQ(refusal(head + "0,A,nan,1\n"), "line 2, column value: 'nan' is not a number such as 97.5");
  EXPECT_EQ(refusal(head + "0,A,1e999,1\n"), "line 2, column value: '1e999' is not a number such as 97.5");
  EXPECT_EQ(refusal(head + "5,A,1,1\n4.999,A,1,1\n"),
            "line 3, column time: '4.999' is before the row above; rows must be in order of time");
  EXPECT_EQ(
      refusal(head + "2026-08-05T00:00:01Z,A,1,1\n2026-08-05T00:00:00Z,A,1,1\n"),
      "line 3, column time: '2026-08-05T00:00:00Z' is before the row above; rows must be in order of time");
  EXPECT_EQ(refusal(head + "-1,A,1,1\n"), "line 2, column time: '-1' is not seconds such as 12.5");
  EXPECT_EQ(refusal(head + ",A,1,1\n"), "line 2, column time: '' is not seconds such as 12.5");
  EXPECT_EQ(refusal(head + "1.0000000001,A,1,1\n"),
            "line 2, column time: '1.0000000001' is not seconds such as 12.5");
  EXPECT_EQ(refusal(head + "00:60:00,A,1,1\n"),
            "line 2, column time: '00:60:00' is not a time such as 00:00:12.5");
  EXPECT_EQ(refusal(head + "1:2:3,A,1,1\n"), "line 2, column time: '1:2:3' is not a time such as 00:00:12.5");
  EXPECT_EQ(refusal(head + "1,A,1,1\n00:00:02,A,1,1\n"),
            "line 3, column time: '00:00:02' is not seconds such as 12.5");
  EXPECT_EQ(
      refusal(head + "2026-08-05T00:00:01+01:00,A,1,1\n"),
      "line 2, column time: '2026-08-05T00:00:01+01:00' is not a UTC time such as 2026-08-05T09:15:02.5Z");
  EXPECT_EQ(refusal(head + "0001-01-01T00:00:00Z,A,1,1\n9999-01-01T00:00:00Z,A,1,1\n"),
            "line 3, column time: '9999-01-01T00:00:00Z' is more than a hundred days after the first row");
  EXPECT_EQ(refusal(head + "0,,1,1\n"), "line 2, column code: is empty");
  EXPECT_EQ(refusal(head + "0,A,1\n"), "line 2 has 3 fields, the first line names 4 columns");
  EXPECT_EQ(refusal(head + "0,A,1,1,1\n"), "line 2 has 5 fields, the first line names 4 columns");
  EXPECT_EQ(refusal(head + "0,A,1,\xB0"
                           "C\n"),
            "line 2: a text is not UTF-8");
  EXPECT_EQ(refusal("time,code,value,unit,quality\n0,A,1,1,so-so\n"),
            "line 2, column quality: 'so-so' is none of good, questionable, invalid, missing, or nothing");
  EXPECT_EQ(refusal("time,code,value,unit,quality\n0,A,,1,good\n"),
            "line 2, column quality: 'good' does not go with the value ''");
  EXPECT_EQ(refusal(head + "0,A,\"1,1\n"), "line 2 opens a quote that is never closed");
  EXPECT_EQ(refusal(head + "0,A,\"1\"2,1\n"), "line 2 has text after a closing quote");
  EXPECT_EQ(refusal(head + "0,A,1\"2,1\n"), "line 2 has a quote within a field that is not quoted");
  EXPECT_EQ(refusal(head + std::string("0,A\0,1,1\n", 9)), "line 2 contains a NUL byte; it is no table");
  EXPECT_EQ(refusal(head + "\"" + std::string(CsvReader::kMaximumRecordBytes, ' ')),
            "line 2 is longer than 1 MiB; is a quote not closed?");
}

TEST_F(CsvSourceTest, GivesWhatStandsBeforeADamagedLineAndEndsThere) {
  const auto source = open("time,code,value,unit\n0,A,1,1\n1,A,2,1\n2,A,x,1\n3,A,4,1\n");
  EXPECT_EQ(std::get<VitalSample>(*source->next()).value, 1);
  EXPECT_EQ(std::get<VitalSample>(*source->next()).value, 2);
  EXPECT_THROW(source->next(), Error);
  EXPECT_FALSE(source->next());
}

TEST_F(CsvSourceTest, RefusesAWrongTableAtOpening) {
  EXPECT_THROW(open("time,code,value\n"), Error);
  EXPECT_THROW(open("time,code,value,unit\n0,A,x,1\n"), Error);
  EXPECT_THROW(open("time,code,value,unit\n", "?zero=noon"), UsageError);
  EXPECT_THROW(open("time,code,value,unit\n", "?loop=1"), UsageError);
}

TEST_F(CsvSourceTest, ReadsATableWithoutRows) { EXPECT_TRUE(read("time,code,value,unit").empty()); }

TEST_F(CsvSourceTest, EndsWhenInterrupted) {
  const auto source = open("time,code,value,unit\n0,A,1,1\n1,A,2,1\n");
  EXPECT_TRUE(source->next());
  source->interrupt();
  EXPECT_FALSE(source->next());
}

TEST(VitalSource, RefusesWhatGivesNoVitalSigns) {
  const CaseClock clock;
  const test::TemporaryFolder folder;
  const auto film = folder.path() / "film.mp4";
  std::ofstream(film) << "x";
  EXPECT_THROW(open_vital_source(parse_source_address(film.string()), clock), UsageError);
  EXPECT_THROW(open_vital_source(parse_source_address("synthetic:room"), clock), UsageError);
  EXPECT_THROW(open_vital_source(parse_source_address("udp://127.0.0.1:1"), clock), UsageError);
}

std::string csv_field(const std::string& field) {
  std::string text = "\"";
  for (const char c : field) {
    text += c == '"' ? "\"\"" : std::string(1, c);
  }
  return text + '"';
}

TEST(CsvReader, ReadsBackWhatWasQuoted) {
  std::mt19937 random(3);
  const std::vector<std::string> pieces = {"a", ",", "\"", "\n", "\r\n", "\r", " ", "é"};
  for (int round = 0; round < 500; ++round) {
    std::vector<std::vector<std::string>> records;
    std::string text;
    for (int r = 0; r < 5; ++r) {
      auto& record = records.emplace_back();
      for (int f = 0; f < 3; ++f) {
        std::string field = f == 0 ? "x" : "";
        for (auto i = random() % 5; i > 0; --i) {
          field += pieces[random() % pieces.size()];
        }
        record.push_back(field);
        text += (f == 0 ? "" : ",") + csv_field(field);
      }
      text += random() % 2 == 0 ? "\n" : "\r\n";
    }
    std::istringstream input(text);
    CsvReader reader(input, "table");
    std::vector<std::string> fields;
    for (const auto& record : records) {
      ASSERT_TRUE(reader.next(fields));
      ASSERT_EQ(fields, record);
    }
    ASSERT_FALSE(reader.next(fields));
    ASSERT_FALSE(reader.next(fields));
  }
}

}  // namespace
}  // namespace kiroku::recorder
