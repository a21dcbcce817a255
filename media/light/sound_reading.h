// Reads the codes of a display (light/) in a case's sound.
#pragma once

#include "media/light/light_reading.h"

namespace kiroku::media {

/// A stream's sound beside the ledger's codes: `light.report` counts stretches of kSoundPeriodSeconds.
struct StreamSound {
  StreamLight light;
  /// Segments that have a track of sound, and those of them with too few samples a second for a code.
  std::uint64_t with_sound = 0, too_slow = 0;
  /// Segments that could be opened, and whose sound could not be decoded to its end. Where nobody could say
  /// whether they have any, they are not among `with_sound`.
  std::uint64_t unheard = 0;
};

/// As read_light(), of the sound beside the stream's pictures. Throws kiroku::UsageError for a stream that
/// there is not or that has no pictures, kiroku::IoError.
StreamSound read_sound(const archive::CaseReader& recording, const light::LedgerLights& ledger,
                       const std::string& stream, const crypto::AgeIdentities& identities,
                       const LightProgress& progress = {});

}  // namespace kiroku::media
