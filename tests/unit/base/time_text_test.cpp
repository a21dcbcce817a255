#include "base/time_text.h"

#include <gtest/gtest.h>

#include "tests/support/nanoseconds.h"

namespace kiroku {
namespace {

TEST(TimeText, ReadsEveryFormThatPeopleWrite) {
  const std::pair<const char*, std::int64_t> kExamples[] = {
      {"90", 90 * kSecond},
      {"0", 0},
      {"12.5", 12 * kSecond + kSecond / 2},
      {"0:05", 5 * kSecond},
      {"90:00", 5400 * kSecond},
      {"00:00:05.5", 5 * kSecond + kSecond / 2},
      {"1:02:03", 3723 * kSecond},
      {"01:02:03.123456789", 3723 * kSecond + 123'456'789},
      {"5s", 5 * kSecond},
      {"500ms", kSecond / 2},
      {"0.5ms", kSecond / 2000},
      {"90m", 5400 * kSecond},
      {"2min", 120 * kSecond},
      {"1.5h", 5400 * kSecond},
      {"1h2m", 3720 * kSecond},
      {"1h2m3.5s", 3723 * kSecond + kSecond / 2},
      {"1h3s", 3603 * kSecond},
      {"1s1ms", kSecond + kSecond / 1000},
      {"0.000000001", 1},
      {"0.000000001h", 3600},
      {"0.123456789h", 444'444'440'400},
      {"10000h", 36'000'000 * kSecond},
  };
  for (const auto& [text, ns] : kExamples) EXPECT_EQ(parse_time_text(text), ns) << text;
}

TEST(TimeText, RefusesEverythingElse) {
  for (const char* text : {"",          " ",          "5 s",          "s",
                           "-5",        "+5",         "1:2",          "1:60",
                           "1:60:00",   "0:00:60",    "1:2:03",       ":05",
                           "5:",        "1:02:",      "1:02:03:04",   "1.5:00",
                           "1:02.5:03", "1:02:03.",   ".5",           "5.",
                           "1e3",       "5sec",       "1m1h",         "1s1s",
                           "1.5h2m",    "2d",         "noon",         "10001h",
                           "nan",       "0x10",       "1.0000000001", "99999999999999999999",
                           "99999999h", "9999:00:60", "36000001",     "５s"}) {
    EXPECT_EQ(parse_time_text(text), std::nullopt) << text;
  }
}

}  // namespace
}  // namespace kiroku
