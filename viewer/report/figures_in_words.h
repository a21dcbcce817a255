// Numbers and times as documents print them, the same in every language. Pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <string>

#include "base/utc_time.h"

namespace kiroku::report {

/// "2026-08-05 09:15:02 UTC"; with `fraction` "2026-08-05 09:15:02.000123 UTC".
std::string utc_time(UtcTime time, bool fraction = false);
/// "0:03:21", with `fraction` "0:03:21.500": hours, minutes and seconds of the case clock or of a length.
std::string case_time(std::int64_t ns, bool fraction = true);
/// "12.3 MB": decimal multiples.
std::string byte_size(std::uint64_t bytes);
/// "18 000": thousands set apart by a space that does not break.
std::string grouped(std::uint64_t number);
/// "0.5": seconds, to the next tenth above.
std::string seconds_up(std::int64_t ns);
/// "+0.013 s".
std::string signed_seconds(std::int64_t ns);

}  // namespace kiroku::report
