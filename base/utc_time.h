// Wall-clock times as text. Pure functions, thread-safe, independent of locale and time zone.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

namespace kiroku {

/// UTC with microseconds, as ledger entries carry it. Wall time is testimony, never used for order or
/// duration.
using UtcTime = std::chrono::sys_time<std::chrono::microseconds>;

/// RFC 3339 with six decimals: "2026-08-05T09:15:02.000123Z".
std::string format_utc(UtcTime time);
/// "20260805T091502Z", as case identifiers begin.
std::string format_utc_compact(UtcTime time);
/// RFC 3339 in UTC ("Z"), with no decimals or one to six of them; nothing for anything else (lower case,
/// offsets, leap seconds, day 30 of February).
std::optional<UtcTime> parse_utc(std::string_view text);
UtcTime utc_now();

}  // namespace kiroku
