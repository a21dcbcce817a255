// The embedded synthetic operating room: pictures that are drawn here (synthetic_scene.h), for demonstration,
// tests and load.
#pragma once

#include "recorder/source/source.h"

namespace kiroku::recorder {

/// synthetic:endoscope (a moving view into a body), synthetic:room (a room with people and a running clock),
/// synthetic:pattern (costs next to nothing). Options: `size=WxH`, `rate=N`, `pixel_format=NAME`, `flash=N`
/// (a white picture at every N-th second of the case clock), `beep=N` (where sound is wanted, a beep of 1 kHz
/// and 100 ms from every N-th second of the case clock on: 48 kHz, one channel), `speed=max`, `change=N` (the
/// picture's size halves after N seconds: for tests of a source that changes). Throws kiroku::UsageError for
/// others.
std::unique_ptr<Source> open_synthetic_source(const SourceAddress& address, const CaseClock& clock,
                                              bool with_sound = false);

}  // namespace kiroku::recorder
