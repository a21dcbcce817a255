#include "recorder/vitals/hl7_time.h"

#include <gtest/gtest.h>

namespace kiroku::recorder {
namespace {

using std::chrono::minutes;
using Precision = Hl7Time::Precision;

std::string utc(std::string_view text, minutes assumed = minutes(0)) {
  const auto time = parse_hl7_time(text);
  return time ? format_utc(time->utc(assumed)) : "nothing";
}

TEST(Hl7Time, ReadsWhatMonitorsSend) {
  EXPECT_EQ(utc("20260727124424.0000+0000"), "2026-07-27T12:44:24.000000Z");
  EXPECT_EQ(utc("20260727124424.1234+0530"), "2026-07-27T07:14:24.123400Z");
  EXPECT_EQ(utc("202607271244240000+0530"), "2026-07-27T07:14:24.000000Z");  // four decimals, no dot
  EXPECT_EQ(utc("20260124131540123+0800"), "2026-01-24T05:15:40.123000Z");   // three
  EXPECT_EQ(utc("20250610015127+0800"), "2025-06-09T17:51:27.000000Z");
  EXPECT_EQ(utc("20250102153045-0500"), "2025-01-02T20:30:45.000000Z");
  EXPECT_EQ(utc("20080818183002.1-0700"), "2008-08-19T01:30:02.100000Z");
  EXPECT_EQ(utc("201410231322-0600"), "2014-10-23T19:22:00.000000Z");
  EXPECT_EQ(utc("20240229000000Z"), "2024-02-29T00:00:00.000000Z");
  EXPECT_EQ(utc(" 20240101000000 "), "2024-01-01T00:00:00.000000Z");
  EXPECT_EQ(utc("20161231235960"), "2017-01-01T00:00:00.000000Z");  // a leap second
}

TEST(Hl7Time, TakesIsoForm) {
  EXPECT_EQ(utc("2025-01-15T14:30:00"), "2025-01-15T14:30:00.000000Z");
  EXPECT_EQ(utc("2025-01-15T14:30:00.25+05:30"), "2025-01-15T09:00:00.250000Z");
  EXPECT_EQ(utc("2025-01-15 14:30:00"), "2025-01-15T14:30:00.000000Z");
  EXPECT_EQ(utc("20250115 1430"), "2025-01-15T14:30:00.000000Z");
}

TEST(Hl7Time, WithoutZoneCountsByTheAssumedOne) {
  EXPECT_EQ(utc("20260124120000", minutes(330)), "2026-01-24T06:30:00.000000Z");
  EXPECT_EQ(utc("20260124120000+0000", minutes(330)), "2026-01-24T12:00:00.000000Z");
  EXPECT_FALSE(parse_hl7_time("20260124120000")->zone);
  EXPECT_EQ(parse_hl7_time("20260124120000-0230")->zone, minutes(-150));
}

TEST(Hl7Time, KnowsHowMuchWasSaid) {
  EXPECT_EQ(parse_hl7_time("1970")->precision, Precision::kYear);
  EXPECT_EQ(parse_hl7_time("197001")->precision, Precision::kMonth);
  EXPECT_EQ(parse_hl7_time("19700102")->precision, Precision::kDay);
  EXPECT_EQ(parse_hl7_time("1970010203")->precision, Precision::kHour);
  EXPECT_EQ(parse_hl7_time("197001020304")->precision, Precision::kMinute);
  EXPECT_EQ(parse_hl7_time("19700102030405")->precision, Precision::kSecond);
  EXPECT_EQ(parse_hl7_time("19700102030405.6")->precision, Precision::kFraction);
  EXPECT_FALSE(parse_hl7_time("20260124")->is_instant());
  EXPECT_TRUE(parse_hl7_time("202601241200")->is_instant());
}

TEST(Hl7Time, RefusesWhatIsNoTime) {
  for (const char* text : {"",
                           "0",
                           "202",
                           "20260",
                           "20260230",
                           "20261301",
                           "2026012425",
                           "202601241260",
                           "20260124120061",
                           "00000000000000",
                           "01/15/2025",
                           "01/15/2025 14:30:00",
                           "20260124120000+",
                           "20260124120000+99",
                           "20260124120000+1500",
                           "20260124120000+0060",
                           "20260124120000.",
                           "20260124120000.1234567",
                           "2026012412.5",
                           "20260124120000 UTC",
                           "yesterday",
                           "20260124120000+08:0",
                           "99999999999999999999999999999999999999999999"}) {
    EXPECT_EQ(utc(text), "nothing") << text;
  }
}

TEST(Hl7Time, WritesWhatItReads) {
  const UtcTime time = *parse_utc("2026-01-24T13:15:40.123Z");
  EXPECT_EQ(format_hl7_time(time), "20260124131540.123+0000");
  EXPECT_EQ(parse_hl7_time(format_hl7_time(time))->utc(minutes(60)), time);
}

}  // namespace
}  // namespace kiroku::recorder
