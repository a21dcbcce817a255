#include "recorder/vitals/sender_zone.h"

#include <gtest/gtest.h>

#include "tests/support/local_zone.h"

namespace kiroku::recorder {
namespace {

std::string shown(const std::string& sent, const std::string& local,
                  const AssumedZone& assumed = AssumedZone::local()) {
  const Hl7Parse parsed = parse_hl7_message("MSH|^~\\&|A||||" + sent + "||SIU^S12|1|P|2.5\r");
  EXPECT_TRUE(parsed.message) << parsed.problem;
  return format_utc(zone_of(*parsed.message, assumed).utc(*parse_utc(local + ":00Z")))
      .substr(0, local.size());
}

TEST(SenderZone, TheZoneOfMsh7GoesBeforeTheAssumedOne) {
  const test::LocalZone tokyo("JST-9");
  EXPECT_EQ(shown("20260805080000+0000", "2026-08-05T09:00"), "2026-08-05T09:00");
  EXPECT_EQ(shown("20260805080000-0500", "2026-08-05T09:00"), "2026-08-05T14:00");
  EXPECT_EQ(shown("20260805080000", "2026-08-05T09:00"), "2026-08-05T00:00");
  EXPECT_EQ(shown("", "2026-08-05T09:00"), "2026-08-05T00:00");
  EXPECT_EQ(shown("20260805080000+0000", "2026-08-05T09:00", std::chrono::minutes(60)), "2026-08-05T09:00");
}

// What is planned for after a change of clocks is planned by the clocks of then.
TEST(SenderZone, ASenderOfThisZoneChangesItsClocksAsThisMachineDoes) {
  const test::LocalZone berlin("CET-1CEST,M3.5.0,M10.5.0/3");
  EXPECT_EQ(shown("20261024180000+0200", "2026-10-24T20:00"), "2026-10-24T18:00");
  EXPECT_EQ(shown("20261024180000+0200", "2026-10-26T09:00"), "2026-10-26T08:00");
  EXPECT_EQ(shown("20261024180000+0100", "2026-10-24T20:00"), "2026-10-24T19:00") << "another zone then";
  EXPECT_EQ(shown("20261025023000+0200", "2026-10-26T09:00"), "2026-10-26T08:00") << "shown twice";
  EXPECT_EQ(shown("20261025023000+0100", "2026-10-26T09:00"), "2026-10-26T08:00");
}

}  // namespace
}  // namespace kiroku::recorder
