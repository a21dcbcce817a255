// Figures for people, and what people type read back. Pure functions, thread-safe, independent of locale
// except where local time is asked for.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/utc_time.h"

namespace kiroku::apps {

/// "999 B", "1.5 kB", "12 MB": decimal multiples, at most two significant decimals.
std::string format_bytes(std::uint64_t bytes);
/// "0:07", "12:34", "1:02:03": whole seconds, rounded down.
std::string format_duration(std::int64_t nanoseconds);
/// "2026-08-05 11:15:02 +0200" in this machine's time zone.
std::string format_local(UtcTime time);
/// "2026-08-05 09:15:02 UTC".
std::string format_utc_for_people(UtcTime time);

/// A length of time as people write it (base/time_text.h), more than nothing and at most 1000 hours. Throws
/// kiroku::UsageError that names `what` ("--duration").
std::chrono::nanoseconds parse_duration(std::string_view text, const std::string& what);
/// The same in a file, of which nobody sees at once what comes of it: refuses a number without a unit, and
/// "24:00", which may be hours and minutes or minutes and seconds.
std::chrono::nanoseconds parse_stated_duration(std::string_view text, const std::string& what);
/// What is refused there. Throws kiroku::UsageError.
void require_unit(std::string_view text, const std::string& what);
/// "4M", "800k", "4000000": bits a second, 1k to 1G. Throws kiroku::UsageError that names `what`.
std::int64_t parse_bit_rate(std::string_view text, const std::string& what);

/// A table of text, columns as wide as their widest cell; columns that `right` names ('r' in it) are aligned
/// right, e.g. "lrr".
std::string format_table(const std::vector<std::vector<std::string>>& rows, std::string_view alignment,
                         std::size_t indent);

}  // namespace kiroku::apps
