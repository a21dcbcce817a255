#include "base/utc_time.h"

#include <gtest/gtest.h>

namespace kiroku {
namespace {

TEST(UtcTime, WritesMicrosecondsAndReadsThemBack) {
  const auto time = parse_utc("2026-08-05T09:15:02.000123Z");
  ASSERT_TRUE(time);
  EXPECT_EQ(format_utc(*time), "2026-08-05T09:15:02.000123Z");
  EXPECT_EQ(format_utc_compact(*time), "20260805T091502Z");
  EXPECT_EQ(time->time_since_epoch().count(), 1'785'921'302'000'123);
}

TEST(UtcTime, ReadsFewerDecimals) {
  EXPECT_EQ(format_utc(*parse_utc("2024-02-29T23:59:59Z")), "2024-02-29T23:59:59.000000Z");
  EXPECT_EQ(format_utc(*parse_utc("2024-02-29T23:59:59.5Z")), "2024-02-29T23:59:59.500000Z");
}

TEST(UtcTime, RefusesWhatIsNoInstant) {
  for (const char* text :
       {"", "2026-08-05", "2026-02-30T00:00:00Z", "2026-08-05T24:00:00Z", "2026-08-05T09:15:60Z",
        "2026-08-05T09:15:02", "2026-08-05T09:15:02+00:00", "2026-08-05t09:15:02z", "2026-08-05T09:15:02.Z",
        "2026-08-05T09:15:02.1234567Z", "2026-08-05T09:15:02Z ", "-026-08-05T09:15:02Z"}) {
    EXPECT_FALSE(parse_utc(text)) << text;
  }
}

}  // namespace
}  // namespace kiroku
