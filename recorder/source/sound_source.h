// Sound from an ALSA capture device: a microphone in the room, or the sound of a capture card, which Linux
// offers apart from its pictures. Read through alsa-lib (https://www.alsa-project.org/alsa-doc/alsa-lib).
#pragma once

#include <memory>

#include "base/error.h"
#include "recorder/source/source.h"

namespace kiroku::recorder {

/// The device was there, and is no more: it was unplugged.
class SoundDeviceGone : public Error {
 public:
  using Error::Error;
};

/// What the address asks for, and open_sound_source() gives. Throws kiroku::UsageError for an option that is
/// none, or out of range.
SoundFormat sound_format_asked(const SourceAddress& address);

/// Opens `alsa:PCM` (SourceKind::kSound); PCM is a name that ALSA knows, such as "hw:1,0" or
/// "plughw:CARD=Mic". Its options are "rate" (samples a second) and "channels"; without them 48000 and 1. The
/// device begins to take sound with the first read().
///
/// All that read() gives is sound; format() is of no picture. The time of each piece is when its first sample
/// was taken, on the case clock: the device's own count of samples is followed by a SoundClock. After an
/// overrun, which is what happens when nobody read for a second, the next piece has lost_before 1.
///
/// Samples are copied and never parsed: there is nothing in them that a decoder could be misled by, so they
/// are read in this process and no box (docs/explanation/threat-model.md). Not thread-safe. No call waits in
/// the driver but opening and closing, so it is read through a SourceGuard. Throws SoundDeviceGone; throws
/// kiroku::Error where there is no such device, another program has it, it offers no such rate, gives nothing
/// for OpeningTerms::silence, or counts samples faster than time passes.
std::unique_ptr<Source> open_sound_source(const SourceAddress& address, const CaseClock& clock,
                                          const OpeningTerms& terms);

}  // namespace kiroku::recorder
