// Times of HL7 v2 messages (data types DTM and TS), as monitors send them. Pure functions, thread-safe.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

#include "base/utc_time.h"
#include "recorder/vitals/assumed_zone.h"

namespace kiroku::recorder {

/// A time on somebody's clock, and how far that clock says it is from UTC, if it says so.
struct Hl7Time {
  enum class Precision { kYear, kMonth, kDay, kHour, kMinute, kSecond, kFraction };
  UtcTime local{};  // the clock's reading, as if it were UTC
  std::optional<std::chrono::minutes> zone;
  Precision precision = Precision::kSecond;

  /// UTC, by the stated zone, else by `assumed`.
  [[nodiscard]] UtcTime utc(const AssumedZone& assumed) const {
    return zone ? local - *zone : assumed.utc(local);
  }
  /// Whether it says when, and not only on which day.
  [[nodiscard]] bool is_instant() const { return precision >= Precision::kMinute; }
};

/// YYYY[MM[DD[HH[MM[SS[[.]f…]]]]]][zone]: the fraction of one to six digits with or without its dot
/// ("20260124131540000+0800"); zone ±hhmm, ±hh:mm or Z. Blanks around it are passed over. Also ISO 8601
/// (2026-01-24T13:15:40.5+08:00) and a blank between day and time. Nothing for anything else: 01/24/2026, day
/// 30 of February, all zeros.
std::optional<Hl7Time> parse_hl7_time(std::string_view text);

/// "20260124131540.123+0000".
std::string format_hl7_time(UtcTime time);
/// "+0530".
std::string format_hl7_zone(std::chrono::minutes zone);

}  // namespace kiroku::recorder
