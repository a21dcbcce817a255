// Case-clock time in the unit that pieces carry. Constants and pure functions; thread-safe.
#pragma once

#include "media/media_ticks.h"

namespace kiroku::playback {

using media::kTicksPerSecond;
using media::ns_of_ticks;
using media::Ticks;
using media::ticks_of_ns;

/// Length of a piece; piece K covers [K * kPieceTicks, (K + 1) * kPieceTicks).
inline constexpr Ticks kPieceTicks = 2 * kTicksPerSecond;
inline constexpr std::int64_t kPieceNs = 2'000'000'000;

}  // namespace kiroku::playback
