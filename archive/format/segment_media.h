// What a segment holds and what its file is called, where a stream's pictures are archived in another form
// from some moment of the case on (docs/reference/format.md, "A change of the profile"). Pure functions,
// thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/format/ledger_entry.h"

namespace kiroku::archive {

/// "video/mp2t" of "mpeg2", "video/x-matroska" of "uncompressed" and "lossless"; nothing of any other
/// profile.
std::optional<std::string_view> media_of_profile(std::string_view profile);

/// The unit of the time stamps of such media, as entries state it (docs/reference/format.md, `segment`).
struct MediaUnit {
  std::string_view time_base;  // "1/90000"
  std::int64_t per_second = 0;
};
MediaUnit unit_of_media(std::string_view media);

/// Whether the format has a stream of such a kind, media and profile (docs/reference/format.md, `open`).
bool is_of_the_format(const StreamInfo& stream);

/// Extensions of plaintext that segments of the stream may have: its own first.
std::vector<std::string> extensions_of(const StreamInfo& stream);

/// The path that the segment must have: with the extension of the profile that its entry states, else of its
/// stream. Nobody knows the profile of one that recovery found in a stream of pictures: its path as it is,
/// where it is one of those that it may have.
std::string file_of(const StreamInfo& stream, const SegmentEntry& segment);

/// What the segment's file holds, by its path: "video/mp2t", …
std::string media_of(const StreamInfo& stream, const SegmentEntry& segment);

/// The form in which its pictures are archived; "" of one that recovery found, where its file alone does not
/// tell.
std::string profile_of(const StreamInfo& stream, const SegmentEntry& segment);

}  // namespace kiroku::archive
