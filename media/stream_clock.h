// Where the time stamps of archived media stand on the case clock. Pure functions; thread-safe.
//
// The packets of a stream carry the time stamps of one muxer time line (docs/reference/format.md):
// case-clock time, in the container's unit, plus a constant of the container. A segment's ledger entry states
// the time stamp of its first picture (`first_pts`) and about when that was (`start_ns`: pictures that came
// in a burst were coded a little later). The least difference of the two over a stream is the constant; so
// every picture's time is known to the tick, also in segments that recovery found, whose entries state none.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "archive/format/ledger_entry.h"
#include "media/media_ticks.h"

namespace kiroku::media {

/// What an entry says of its first picture.
struct FirstPicture {
  Ticks stamp = 0;
  /// Time stamp minus case-clock time, both in the container's unit: in whole units both were rounded alike.
  Ticks offset = 0;
};
/// Nothing where the entry states no time stamp, or one in a unit that is not made of whole ticks.
std::optional<FirstPicture> first_picture_of(const archive::SegmentEntry& segment);

/// The constant of a stream in one container, of which these are all segments; nothing where no entry states
/// a time stamp.
std::optional<Ticks> stamp_offset(const std::vector<archive::SegmentEntry>& segments);

/// The constants of a stream, of which these are all segments, by container (archive::media_of).
std::map<std::string, Ticks> stamp_offsets(const archive::StreamInfo& stream,
                                           const std::vector<archive::SegmentEntry>& segments);

/// A segment found by recovery may begin so much before the time that its entry estimates.
inline constexpr std::int64_t kEarliestBeforeEstimateNs = 1'000'000'000;

/// Time stamps of MPEG-TS have 33 bits (ISO 13818-1, 2.4.3.7).
inline constexpr Ticks kTransportWrap = Ticks{1} << 33;
/// Of two such time stamps the difference that is nearest to zero.
constexpr Ticks unwrapped(Ticks difference) {
  constexpr Ticks kHalf = kTransportWrap / 2;
  return (((difference + kHalf) % kTransportWrap) + kTransportWrap) % kTransportWrap - kHalf;
}

}  // namespace kiroku::media
