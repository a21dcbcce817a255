// Where the time stamps of archived media stand on the case clock. Pure functions and values; thread-safe.
//
// The packets of a stream carry the time stamps of one muxer time line (docs/reference/format.md):
// case-clock time, in the container's unit, plus a constant of the container. A segment's ledger entry states
// the time stamp of its first picture (`first_pts`) and about when that was (`start_ns`: pictures that came
// in a burst were coded a little later). The least difference of the two over a stream is the constant; so
// every picture's time is known to the tick, also in segments that recovery found, whose entries state none.
//
// An entry may state anything. What lies further from the middle of all differences than a burst explains has
// no say in the constant; such a segment stands where its `start_ns` says, and moves no other.
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
/// Nothing where the entry states no time stamp, or one in another unit than that of its media, or that is
/// not made of whole ticks.
std::optional<FirstPicture> first_picture_of(const archive::StreamInfo& stream,
                                             const archive::SegmentEntry& segment);

/// The constants of one stream, by container (archive::media_of).
class StreamClock {
 public:
  StreamClock() = default;
  /// `segments`: all of the stream.
  StreamClock(archive::StreamInfo stream, const std::vector<archive::SegmentEntry>& segments);
  /// What to take from the time stamps in a segment's file for case-clock time; nothing where no entry of its
  /// container states a time stamp.
  [[nodiscard]] std::optional<Ticks> offset_of(const archive::SegmentEntry& segment) const;
  /// The constant of one container, which no single entry moves by more than a burst explains.
  [[nodiscard]] std::optional<Ticks> constant_of(const std::string& media) const;

 private:
  archive::StreamInfo stream_;
  std::map<std::string, Ticks> constants_;  // by media
};

/// A picture of a burst is stamped at most so much later than it came, and the verifier's tolerance.
inline constexpr Ticks kLatestStamp = kTicksPerSecond * 11 / 10;

/// A segment found by recovery may begin so much before the time that its entry estimates.
inline constexpr std::int64_t kEarliestBeforeEstimateNs = 1'000'000'000;
/// And so much after it.
inline constexpr std::int64_t kLatestAfterEstimateNs = 3'600'000'000'000;

/// Whether a segment of so many pictures may hold one so long after `start_ns`, by its entry.
bool may_lie(const archive::SegmentEntry& segment, Ticks since, std::uint64_t pictures);

/// Time stamps of MPEG-TS have 33 bits (ISO 13818-1, 2.4.3.7).
inline constexpr Ticks kTransportWrap = Ticks{1} << 33;
/// Of two such time stamps the difference that is nearest to zero.
constexpr Ticks unwrapped(Ticks difference) {
  constexpr Ticks kHalf = kTransportWrap / 2;
  return (((difference + kHalf) % kTransportWrap) + kTransportWrap) % kTransportWrap - kHalf;
}

}  // namespace kiroku::media
