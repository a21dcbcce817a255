#include "media/stream_clock.h"

#include <algorithm>
#include <charconv>

#include "archive/format/segment_media.h"

namespace kiroku::media {
namespace {

/// Ticks of one unit of "n/d"; nothing for a base that is none or not made of whole ticks.
std::optional<Ticks> unit_of(const std::string& time_base) {
  std::int64_t numerator = 0;
  std::int64_t denominator = 0;
  const char* const end = time_base.data() + time_base.size();
  const auto upper = std::from_chars(time_base.data(), end, numerator);
  if (upper.ptr == end || *upper.ptr != '/' || std::from_chars(upper.ptr + 1, end, denominator).ptr != end ||
      numerator < 1 || denominator < 1 || kTicksPerSecond * numerator % denominator != 0) {
    return std::nullopt;
  }
  return kTicksPerSecond * numerator / denominator;
}

}  // namespace

std::optional<FirstPicture> first_picture_of(const archive::SegmentEntry& segment) {
  const auto unit = segment.counted ? unit_of(segment.time_base) : std::nullopt;
  if (!unit) return std::nullopt;
  constexpr std::int64_t kTickUnit = 100'000;  // 9 ticks
  const std::int64_t divisor = kTickUnit * *unit;
  const std::int64_t start = (segment.span.start_ns * 9 + divisor / 2) / divisor;
  return FirstPicture{segment.first_pts * *unit, (segment.first_pts - start) * *unit};
}

std::optional<Ticks> stamp_offset(const std::vector<archive::SegmentEntry>& segments) {
  std::optional<Ticks> offset;
  for (const archive::SegmentEntry& segment : segments) {
    if (const auto first = first_picture_of(segment)) {
      offset = std::min(offset.value_or(first->offset), first->offset);
    }
  }
  return offset;
}

std::map<std::string, Ticks> stamp_offsets(const archive::StreamInfo& stream,
                                           const std::vector<archive::SegmentEntry>& segments) {
  std::map<std::string, std::vector<archive::SegmentEntry>> of_media;
  for (const archive::SegmentEntry& segment : segments)
    of_media[archive::media_of(stream, segment)].push_back(segment);
  std::map<std::string, Ticks> offsets;
  for (const auto& [media, its_own] : of_media) {
    if (const auto offset = stamp_offset(its_own)) offsets[media] = *offset;
  }
  return offsets;
}

}  // namespace kiroku::media
