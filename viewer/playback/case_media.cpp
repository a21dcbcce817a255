#include "viewer/playback/case_media.h"

#include <algorithm>
#include <utility>

#include "archive/format/segment_media.h"
#include "base/error.h"
#include "media/stream_clock.h"

namespace kiroku::playback {
namespace {

/// How much later than its entry says a segment may end: pictures of a burst are spread over time to come.
constexpr Ticks kLongestSpread = 2 * kTicksPerSecond;
/// And one whose times recovery estimated.
constexpr Ticks kLongestEstimate = 12 * kTicksPerSecond;

VideoIndex index_of(const archive::CaseReader& recording, const archive::StreamInfo& stream) {
  VideoIndex index;
  index.stream = stream;
  std::vector<archive::SegmentEntry> segments = recording.segments(stream.name, INT64_MIN, INT64_MAX);
  const media::StreamClock clock(stream, segments);
  std::string profile_before;
  std::int64_t before_ended_ns = INT64_MIN;
  for (archive::SegmentEntry& segment : segments) {
    const std::int64_t end_ns = segment.span.end_ns;
    if (recording.erasure_of(segment) == nullptr) {
      IndexedSegment indexed;
      const auto first = media::first_picture_of(stream, segment);
      indexed.offset = clock.offset_of(segment);
      indexed.start = first ? first->stamp - *indexed.offset : ticks_of_ns(segment.span.start_ns);
      indexed.end = ticks_of_ns(end_ns) + (segment.counted ? kLongestSpread : kLongestEstimate);
      indexed.begins_run = index.segments.empty() || segment.span.start_ns != before_ended_ns ||
                           !segment.counted || archive::profile_of(stream, segment) != profile_before;
      profile_before = archive::profile_of(stream, segment);
      if (!index.segments.empty() && segment.counted) {
        index.segments.back().end = std::min(index.segments.back().end, indexed.start);
      }
      indexed.entry = std::move(segment);
      index.segments.push_back(std::move(indexed));
    }
    before_ended_ns = end_ns;
  }
  // Pictures may change their form in no time at all: then the gap that says so is empty.
  for (const archive::GapEntry& gap : recording.gaps(stream.name)) {
    const auto after = std::lower_bound(
        index.segments.begin(), index.segments.end(), gap.span.end_ns,
        [](const IndexedSegment& segment, std::int64_t ns) { return segment.entry.span.start_ns < ns; });
    if (after != index.segments.end() && after->entry.span.start_ns == gap.span.end_ns) {
      after->begins_run = true;
    }
  }
  return index;
}

}  // namespace

std::size_t VideoIndex::first_reaching(Ticks time) const {
  const auto found = std::find_if(segments.begin(), segments.end(),
                                  [&](const IndexedSegment& segment) { return segment.end > time; });
  return static_cast<std::size_t>(found - segments.begin());
}

bool VideoIndex::may_hold(Ticks from, Ticks to) const {
  const std::size_t first = first_reaching(from);
  return first < segments.size() && segments[first].start < to;
}

CaseMedia::CaseMedia(archive::CaseReader recording, crypto::AgeIdentities identities,
                     std::shared_ptr<const archive::SealedSource> segments)
    : recording_(std::move(recording)),
      identities_(std::move(identities)),
      folder_(archive::CaseFolder::open(recording_.folder())),
      segments_(std::move(segments)) {
  for (const archive::StreamInfo& stream : recording_.opening().streams) {
    if (stream.kind == "video") {
      videos_.push_back(index_of(recording_, stream));
    }
  }
}

const VideoIndex& CaseMedia::video(const std::string& stream) const {
  const auto found = std::find_if(videos_.begin(), videos_.end(),
                                  [&](const VideoIndex& index) { return index.stream.name == stream; });
  if (found == videos_.end()) {
    throw UsageError("stream '" + recording_.stream(stream).name + "' has no pictures; choose a video");
  }
  return *found;
}

void CaseMedia::expect(const VideoIndex& index, std::size_t first, Ticks before) const {
  if (!segments_) return;
  for (std::size_t i = first; i < index.segments.size() && index.segments[i].start < before; ++i)
    segments_->expect(index.segments[i].entry);
}

media::SealedSegment CaseMedia::open(const archive::SegmentEntry& segment) const {
  return segments_ ? media::SealedSegment::open(*segments_, segment, identities_, checked_)
                   : media::SealedSegment::open(folder_, segment, identities_, checked_);
}

}  // namespace kiroku::playback
