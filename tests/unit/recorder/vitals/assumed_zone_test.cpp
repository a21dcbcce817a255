#include "recorder/vitals/assumed_zone.h"

#include <gtest/gtest.h>

#include "tests/support/local_zone.h"

namespace kiroku::recorder {
namespace {

std::string shown(const AssumedZone& zone, const std::string& local, const std::string& near = "") {
  const UtcTime time = *parse_utc(local + ":00Z");
  const auto by = near.empty() ? std::nullopt : std::optional(*parse_utc(near + ":00Z"));
  return format_utc(zone.utc(time, by)).substr(0, local.size());
}

TEST(AssumedZone, OfThisMachineGoesByTheRulesOfTheMomentThatIsMeant) {
  const test::LocalZone berlin("CET-1CEST,M3.5.0,M10.5.0/3");
  const AssumedZone zone = AssumedZone::local();
  EXPECT_EQ(shown(zone, "2026-01-15T09:00"), "2026-01-15T08:00");
  EXPECT_EQ(shown(zone, "2026-07-15T09:00"), "2026-07-15T07:00");
  EXPECT_EQ(shown(zone, "2026-03-29T01:59"), "2026-03-29T00:59");
  EXPECT_EQ(shown(zone, "2026-03-29T02:30"), "2026-03-29T01:30") << "which no clock showed";
  EXPECT_EQ(shown(zone, "2026-03-29T03:00"), "2026-03-29T01:00");
  EXPECT_EQ(shown(zone, "2026-10-25T01:59"), "2026-10-24T23:59");
  EXPECT_EQ(shown(zone, "2026-10-25T03:00"), "2026-10-25T02:00");
  // Shown twice.
  EXPECT_EQ(shown(zone, "2026-10-25T02:30", "2026-10-25T00:31"), "2026-10-25T00:30");
  EXPECT_EQ(shown(zone, "2026-10-25T02:30", "2026-10-25T01:31"), "2026-10-25T01:30");
}

TEST(AssumedZone, FixedIsAlwaysTheSame) {
  const test::LocalZone berlin("CET-1CEST,M3.5.0,M10.5.0/3");
  EXPECT_EQ(shown(std::chrono::minutes(330), "2026-07-15T09:00"), "2026-07-15T03:30");
  EXPECT_EQ(shown(std::chrono::minutes(-480), "2026-01-15T09:00"), "2026-01-15T17:00");
}

}  // namespace
}  // namespace kiroku::recorder
