// Sound from an ALSA capture device: a microphone in the room, or the sound of a capture card, which Linux
// offers apart from its pictures.
#pragma once

#include <memory>

#include "recorder/source/source.h"

namespace kiroku::recorder {

/// What the address asks for, and open_sound_source() gives. Throws kiroku::UsageError for an option that is
/// none, or out of range.
SoundFormat sound_format_asked(const SourceAddress& address);

/// Opens `alsa:PCM` (SourceKind::kSound) through libavdevice; PCM is a name that ALSA knows, such as "hw:1,0"
/// or "plughw:CARD=Mic". Its options are "rate" (samples a second) and "channels"; without them 48000 and 1.
///
/// All that read() gives is sound; format() is of no picture. The time of each piece is when its first sample
/// was taken, on the case clock: what ALSA says of its delay is taken off. Not thread-safe; no call waits in
/// the driver but opening and closing, so it is read through a SourceGuard. Throws kiroku::Error where there
/// is no such device, another program has it, or it is lost.
std::unique_ptr<Source> open_sound_source(const SourceAddress& address, const CaseClock& clock,
                                          const OpeningTerms& terms);

}  // namespace kiroku::recorder
