// Files, FIFOs, V4L2 devices and network streams through libavformat and libavdevice.
#pragma once

#include "recorder/source/source.h"

namespace kiroku::recorder {

/// Options of files: `speed=max`, `loop=1`; of devices: `size=WxH`, `rate=N`, `format=NAME` (as `ffmpeg -f
/// v4l2` calls them). Frames of devices, pipes and network streams are stamped when their data arrives; those
/// of files carry the file's own times, beginning at 0 and always going forward, over loops and jumps. Throws
/// kiroku::Error: cannot be opened, holds no picture, empty file, no decoder.
///
/// Waits for a device without waiting in its driver. Other waits may be the operating system's, so it is for
/// a thread that can be given up (source_guard.h).
std::unique_ptr<Source> open_ffmpeg_source(const SourceAddress& address, const CaseClock& clock,
                                           const OpeningTerms& terms);

}  // namespace kiroku::recorder
