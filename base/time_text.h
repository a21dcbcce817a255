// How people write times: one grammar for every command, configuration and document. Pure functions,
// thread-safe, independent of locale.
//
//   90  12.5              seconds
//   0:05  90:00  1:02:03.5  minutes and seconds, or hours, minutes and seconds; two digits behind each colon
//   500ms 5s 90m 1.5h 1h2m3.5s  numbers with units, the larger first; `min` is `m`
//
// At most nine decimals, at the last number alone.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace kiroku {

/// For help and for errors: what a person may write.
inline constexpr std::string_view kTimeForms = "5s, 0:05, 1:02:03.5, 1h2m or 90 (seconds)";

/// Nanoseconds, exact; nothing for any other text, a sign, or more than 10,000 hours.
std::optional<std::int64_t> parse_time_text(std::string_view text);

}  // namespace kiroku
