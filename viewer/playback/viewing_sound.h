// The sound of a viewing copy: FLAC of 16 bit in fragments of MP4, which browsers play. It has no priming and
// no memory, so that pieces made apart are sample for sample what is made of the whole; none of this is true
// of AAC or Opus. Thread-safe.
#pragma once

#include <cstdint>

#include "base/bytes.h"
#include "viewer/playback/case_media.h"
#include "viewer/playback/fragment_muxer.h"
#include "viewer/playback/sound_reader.h"

namespace kiroku::playback {

/// Samples a second in the copy: the archive's own up to 48,000, else a whole part of it.
int viewing_rate_of(const SoundForm& form);

InitSegment make_sound_init_segment(const SoundForm& form);

/// Piece `number` covers what the piece of pictures of that number may hold (VideoIndex::may_hold), to a
/// block of 80 ms: from the first segment in it to the end of the last. Sound stands where it stands in the
/// archive, to the sample; where there is none there is silence, for a browser shows no picture where its
/// sound lacks. Empty where no segment is. Throws as SoundReader.
Bytes make_sound_piece(const SegmentOpener& media, const VideoIndex& index, const SoundForm& form,
                       std::uint64_t number);

}  // namespace kiroku::playback
