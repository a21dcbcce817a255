// Whether a segment's file is one container with one film and nothing beside it, so that no program can read
// another film out of the same bytes (docs/reference/format.md, "What a segment holds").
#pragma once

#include <cstdint>
#include <set>
#include <string>

#include "crypto/byte_source.h"

struct AVFormatContext;

namespace kiroku::media {

/// The numbers under which a file carries anything: MPEG-TS's packet identifiers, Matroska's track numbers.
using CarriedNumbers = std::set<std::uint64_t>;

/// Reads the container's own structure from the first byte to the last. A `video/mp2t` is whole packets of
/// 188 bytes; a `video/x-matroska` is one header and one segment of the elements that recorders write, with
/// nothing behind. Where `complete` is false it may end anywhere. Throws MediaError for any other form, with
/// `name`, and whatever the source throws. Thread-safe.
CarriedNumbers numbers_carried(const crypto::ByteSource& source, const std::string& media, bool complete,
                               const std::string& name);

/// Asks of what a demuxer found, after it read to the end, for one stream of pictures, at most one of sound
/// and no other, and that the file carries nothing beside them. Throws MediaError.
void require_one_film(const AVFormatContext& found, const CarriedNumbers& carried, const std::string& name);

}  // namespace kiroku::media
