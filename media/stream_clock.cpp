#include "media/stream_clock.h"

#include <algorithm>
#include <utility>

#include "archive/format/segment_media.h"

namespace kiroku::media {
std::optional<FirstPicture> first_picture_of(const archive::StreamInfo& stream,
                                             const archive::SegmentEntry& segment) {
  const archive::MediaUnit of = archive::unit_of_media(archive::media_of(stream, segment));
  if (!segment.counted || segment.time_base != of.time_base || kTicksPerSecond % of.per_second != 0)
    return std::nullopt;
  const Ticks unit = kTicksPerSecond / of.per_second;
  constexpr std::int64_t kTickUnit = 100'000;  // 9 ticks
  const std::int64_t divisor = kTickUnit * unit;
  const std::int64_t start = (segment.span.start_ns * 9 + divisor / 2) / divisor;
  return FirstPicture{segment.first_pts * unit, (segment.first_pts - start) * unit};
}

StreamClock::StreamClock(archive::StreamInfo stream, const std::vector<archive::SegmentEntry>& segments)
    : stream_(std::move(stream)) {
  std::map<std::string, std::vector<Ticks>> of_media;
  for (const archive::SegmentEntry& segment : segments) {
    if (const auto first = first_picture_of(stream_, segment))
      of_media[archive::media_of(stream_, segment)].push_back(first->offset);
  }
  for (auto& [media, offsets] : of_media) {
    std::ranges::sort(offsets);
    const Ticks middle = offsets[(offsets.size() - 1) / 2];
    constants_[media] = *std::ranges::lower_bound(offsets, middle - kLatestStamp);
  }
}

std::optional<Ticks> StreamClock::constant_of(const std::string& media) const {
  const auto constant = constants_.find(media);
  return constant == constants_.end() ? std::nullopt : std::optional(constant->second);
}

std::optional<Ticks> StreamClock::offset_of(const archive::SegmentEntry& segment) const {
  const std::optional<Ticks> constant = constant_of(archive::media_of(stream_, segment));
  const auto first = first_picture_of(stream_, segment);
  if (!constant || !first) return constant;
  const Ticks late = first->offset - *constant;
  return late < 0 || late > kLatestStamp ? first->offset : *constant;
}

bool may_lie(const archive::SegmentEntry& segment, Ticks since, std::uint64_t pictures) {
  if (!segment.counted) {
    return since >= -ticks_of_ns(kEarliestBeforeEstimateNs) && since <= ticks_of_ns(kLatestAfterEstimateNs);
  }
  // Matroska states whole milliseconds, and no picture is stamped as the one before it.
  constexpr Ticks kMillisecond = kTicksPerSecond / 1'000;
  constexpr std::uint64_t kMost = std::uint64_t{1} << 32;
  const Ticks lasts = ticks_of_ns(segment.span.end_ns - segment.span.start_ns);
  return since >= -kMillisecond &&
         since <= lasts + kLatestStamp + static_cast<Ticks>(std::min(pictures, kMost)) * kMillisecond;
}

}  // namespace kiroku::media
