// A source that is opened, demuxed and decoded by a process of its own, which holds no key and can do nothing
// else (source_box.h, media/box): what a camera, a network or a file sends is hostile until it is pixels.
#pragma once

#include <memory>

#include "recorder/source/source.h"

namespace kiroku::recorder {

/// As open_ffmpeg_source(), but that a decoder which gives no sign of life for `terms.silence` is killed, and
/// that read() throws kiroku::Error where it was, or ended by itself. Its pictures lie in memory that it may
/// still write to: who reads one twice may read two. Their times are held within what the clock allows, their
/// sizes within the memory. The thread that opens the source reads and closes it. No call waits longer than
/// `terms.silence` for the decoder, but for the kernel to let a killed one go.
std::unique_ptr<Source> open_boxed_source(const SourceAddress& address, const CaseClock& clock,
                                          const OpeningTerms& terms);

}  // namespace kiroku::recorder
