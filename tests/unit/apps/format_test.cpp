#include "apps/common/format.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::apps {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(Format, WritesBytesWithTwoOrThreeFigures) {
  EXPECT_EQ(format_bytes(0), "0 B");
  EXPECT_EQ(format_bytes(999), "999 B");
  EXPECT_EQ(format_bytes(1'000), "1.00 kB");
  EXPECT_EQ(format_bytes(12'345'678), "12.3 MB");
  EXPECT_EQ(format_bytes(249'000'000), "249 MB");
  EXPECT_EQ(format_bytes(999'999'999), "1.00 GB");
}

TEST(Format, WritesDurationsInWholeSeconds) {
  EXPECT_EQ(format_duration(0), "0:00");
  EXPECT_EQ(format_duration(7'999'999'999), "0:07");
  EXPECT_EQ(format_duration(3'723'000'000'000), "1:02:03");
  EXPECT_EQ(format_duration(-5), "0:00");
}

TEST(Format, ReadsDurationsWithUnitOrAsClock) {
  EXPECT_EQ(parse_duration("20s", "x"), seconds(20));
  EXPECT_EQ(parse_duration("1.5s", "x"), milliseconds(1500));
  EXPECT_EQ(parse_duration("500ms", "x"), milliseconds(500));
  EXPECT_EQ(parse_duration("90m", "x"), seconds(5400));
  EXPECT_EQ(parse_duration("2h", "x"), seconds(7200));
  EXPECT_EQ(parse_duration("01:02:03.250", "x"), seconds(3723) + milliseconds(250));
  EXPECT_EQ(parse_duration("0:05", "x"), seconds(5));
  EXPECT_EQ(parse_duration("1h2m", "x"), seconds(3720));
  EXPECT_EQ(parse_duration("20", "x"), seconds(20));
}

TEST(Format, RefusesWhatIsNoDuration) {
  for (const char* text : {"", "s", "-1s", "0", "1001h", "0s", "1:2", "00:60:00", "00:00:60", "1e3s",
                           "9999999h", "1.5:00:00", "nan", "infs", "00:00:00", "1 s"}) {
    EXPECT_THROW(parse_duration(text, "--duration"), UsageError) << text;
  }
}

// Of a file nobody sees at once what comes of it: 24 hours were meant, and 24 seconds would be taken.
TEST(Format, ADurationInAFileSaysOfWhatItIs) {
  EXPECT_EQ(parse_stated_duration("24h", "x"), seconds(86'400));
  EXPECT_EQ(parse_stated_duration("15min", "x"), seconds(900));
  EXPECT_EQ(parse_stated_duration("15m", "x"), seconds(900));
  EXPECT_EQ(parse_stated_duration("0:15:00", "x"), seconds(900));
  EXPECT_EQ(parse_stated_duration("500ms", "x"), milliseconds(500));
  const auto refusal = [](const char* text) -> std::string {
    try {
      (void)parse_stated_duration(text, "'k'");
    } catch (const UsageError& error) {
      return error.what();
    }
    return "accepted";
  };
  for (const char* text : {"24", "1.5", "0"})
    EXPECT_EQ(refusal(text),
              "'k' is '" + std::string(text) + "', which does not say of what: write 24h, 15min or 90s");
  EXPECT_NE(refusal("24:00").find("may be hours and minutes, or minutes and seconds"), std::string::npos);
  for (const char* text : {"", "soon", "0s", "1001h"})
    EXPECT_NE(refusal(text).find("which is no length of time: write 24h"), std::string::npos) << text;
}

TEST(Format, ReadsBitRates) {
  EXPECT_EQ(parse_bit_rate("4M", "x"), 4'000'000);
  EXPECT_EQ(parse_bit_rate("800k", "x"), 800'000);
  EXPECT_EQ(parse_bit_rate("1.5M", "x"), 1'500'000);
  EXPECT_EQ(parse_bit_rate("64000", "x"), 64'000);
  for (const char* text : {"", "M", "4G", "-4M", "1", "2000M"})
    EXPECT_THROW(parse_bit_rate(text, "x"), UsageError) << text;
}

TEST(Format, AlignsTables) {
  EXPECT_EQ(format_table({{"name", "n"}, {"é", "10"}}, "lr", 2), "  name   n\n  é     10\n");
}

}  // namespace
}  // namespace kiroku::apps
