// Files, FIFOs, V4L2 devices and network streams through libavformat and libavdevice.
#pragma once

#include "recorder/source/source.h"

namespace kiroku::recorder {

/// Options of files: `speed=max`, `loop=1`; of devices: `size=WxH`, `rate=N`, `format=NAME`. Throws
/// kiroku::Error: cannot be opened, holds no picture, empty file, no decoder.
std::unique_ptr<Source> open_ffmpeg_source(const SourceAddress& address, const CaseClock& clock);

}  // namespace kiroku::recorder
