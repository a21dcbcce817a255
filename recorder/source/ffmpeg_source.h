// Files, FIFOs, V4L2 devices and network streams through libavformat and libavdevice.
#pragma once

#include "recorder/source/source.h"

namespace kiroku::recorder {

/// Options of files: `speed=max`, `loop=1`; of devices: `size=WxH`, `rate=N`, `format=NAME` (as `ffmpeg -f
/// v4l2` calls them). Frames of devices, pipes and network streams are stamped when their data arrives; those
/// of files carry the file's own times, beginning at 0 and always going forward, over loops and jumps: a jump
/// ahead is followed up to kLongestHoleNs, and up to kLongestPacedHoleNs where it would have to be waited
/// for. Where it is longer, and where times go back, the picture has a TimeBreak, and one before it counts as
/// lost. Pictures that say how they are turned or mirrored are given so, where that loses nothing
/// (picture_turn.h). Throws kiroku::Error: cannot be opened, holds no picture, empty file, no decoder.
///
/// Waits for a device without waiting in its driver. Other waits may be the operating system's, so it is for
/// a thread that can be given up (source_guard.h).
inline constexpr std::int64_t kLongestHoleNs = 86'400'000'000'000;  // a day
inline constexpr std::int64_t kLongestPacedHoleNs = 10'000'000'000;
inline constexpr std::int64_t kLongestFilmNs = 31 * kLongestHoleNs;  // a ledger's numbers are below 2^53
/// Decoders give times out of order by a picture or two; what goes back further is another recording.
inline constexpr std::int64_t kLeastStepBackNs = 500'000'000;

std::unique_ptr<Source> open_ffmpeg_source(const SourceAddress& address, const CaseClock& clock,
                                           const OpeningTerms& terms);

}  // namespace kiroku::recorder
