// A stream's viewing copy made from its segments: the form of all of its pictures, and one piece.
// Thread-safe.
#pragma once

#include <cstdint>

#include "base/bytes.h"
#include "viewer/playback/case_media.h"
#include "viewer/playback/viewing_format.h"

namespace kiroku::playback {

/// The form that all of the stream's pictures go into: that of the largest. Throws kiroku::UsageError where
/// it has no picture, and as PictureReader where none can be read.
ViewingFormat find_viewing_format(const SegmentOpener& media, const VideoIndex& index);

/// Piece `number` (CasePlayback::piece). Throws as PictureReader.
Bytes make_viewing_piece(const SegmentOpener& media, const VideoIndex& index, const ViewingFormat& format,
                         std::uint64_t number);

}  // namespace kiroku::playback
