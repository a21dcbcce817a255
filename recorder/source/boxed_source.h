// A source that is opened, demuxed and decoded by a process of its own, which holds no key and can do nothing
// else (source_box.h, media/box): what a camera, a network or a file sends is hostile until it is pixels.
#pragma once

#include <memory>
#include <string>

#include "recorder/source/source.h"

namespace kiroku::recorder {

/// As open_ffmpeg_source(), but that a decoder which gives no sign of life for `terms.silence` is killed, and
/// that read() throws DecoderLost where it was, or ended by itself. Its pictures lie in memory that it may
/// still write to: who reads one twice may read two. Their times are held within what the clock allows, their
/// sizes within the memory. The thread that opens the source reads and closes it. No call waits longer than
/// `terms.silence` for the decoder, but for the kernel to let a killed one go.
std::unique_ptr<Source> open_boxed_source(const SourceAddress& address, const CaseClock& clock,
                                          const OpeningTerms& terms);

/// Why this process decodes its sources itself: a sentence on why there is no box here, such as a kernel
/// without seccomp, or a program that is not installed; "" where there is one. Looked at anew until a box was
/// there once, which takes as long as a process takes to start; never again after. `pulse` may be null.
/// Thread-safe.
std::string why_unboxed(Pulse* pulse = nullptr);

/// As open_boxed_source(), but that a source is opened without a box where why_unboxed() says so: an
/// operation does not come again. The source then remarks it. No source can bring that about: it is only
/// asked before the process's first box.
std::unique_ptr<Source> open_captured_source(const SourceAddress& address, const CaseClock& clock,
                                             const OpeningTerms& terms);

}  // namespace kiroku::recorder
