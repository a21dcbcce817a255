// Case-clock time in the unit of MPEG-2 transport streams. Constants and pure functions; thread-safe.
#pragma once

#include <cstdint>

namespace kiroku::media {

/// 1/90000 s: the unit of MPEG-2 transport streams, a whole multiple of which Matroska's milliseconds are, so
/// that an archived picture's time is a whole number of them.
using Ticks = std::int64_t;

inline constexpr Ticks kTicksPerSecond = 90'000;

/// To the nearest tick, which gives back the ticks that ns_of_ticks() was given.
constexpr Ticks ticks_of_ns(std::int64_t ns) {
  // 9/100000, split so that nothing overflows within 292 years of the case clock
  constexpr std::int64_t kUnit = 100'000;
  const std::int64_t whole = ns / kUnit;
  const std::int64_t rest = ns % kUnit * 9;
  return whole * 9 + (rest + (rest >= 0 ? kUnit / 2 : -kUnit / 2)) / kUnit;
}
/// To the nearest nanosecond.
constexpr std::int64_t ns_of_ticks(Ticks ticks) {
  const std::int64_t rest = ticks % 9 * 100'000;
  return ticks / 9 * 100'000 + (rest + (rest >= 0 ? 4 : -4)) / 9;
}

}  // namespace kiroku::media
