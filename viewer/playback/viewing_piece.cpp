#include "viewer/playback/viewing_piece.h"

#include <algorithm>
#include <exception>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "archive/format/segment_media.h"
#include "base/error.h"
#include "viewer/playback/picture_reader.h"
#include "viewer/playback/piece_encoder.h"
#include "viewer/playback/viewing_pictures.h"

namespace kiroku::playback {
namespace {

/// Where a stream's pictures may have changed is looked at so often at most: the first picture must not wait
/// for all interruptions of a long day.
constexpr std::size_t kMostRunsLookedAt = 24;
/// A picture lasts until the next one, unless that is so far away that nobody knows what was to be seen.
constexpr Ticks kLongestPicture = 2 * kTicksPerSecond;
constexpr Ticks kUnknownDuration = kTicksPerSecond / 25;

int decoding_threads(const VideoIndex& index) {
  // FFV1, which is in Matroska, takes several times as long as the others.
  const bool may_be_lossless = std::ranges::any_of(index.segments, [&](const IndexedSegment& segment) {
    return archive::media_of(index.stream, segment.entry) == "video/x-matroska";
  });
  return may_be_lossless ? std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 4) : 1;
}

}  // namespace

ViewingFormat find_viewing_format(const SegmentOpener& media, const VideoIndex& index) {
  std::optional<ViewingFormat> largest;
  std::exception_ptr failure;
  std::size_t looked_at = 0;
  for (const IndexedSegment& segment : index.segments) {
    if (!segment.begins_run) continue;
    if (looked_at++ == kMostRunsLookedAt) break;
    try {
      PictureReader reader(media, index);
      reader.seek(segment.start);
      const std::optional<ArchivedPicture> picture = reader.next();
      if (!picture) continue;
      const ViewingFormat format = viewing_format_of(*picture->frame, picture->usual_duration);
      if (!largest || format.width * format.height > largest->width * largest->height) largest = format;
    } catch (const Error&) {
      if (!failure) failure = std::current_exception();
    }
  }
  if (largest) return *largest;
  if (failure) std::rethrow_exception(failure);
  throw UsageError("stream '" + index.stream.name + "' has no picture in it");
}

Bytes make_viewing_piece(const SegmentOpener& media, const VideoIndex& index, const ViewingFormat& format,
                         std::uint64_t number) {
  const Ticks from = static_cast<Ticks>(number) * kPieceTicks;
  const Ticks to = from + kPieceTicks;
  PictureReader reader(media, index, Decoding::kEveryPicture, decoding_threads(index));
  reader.stop_before(to);
  reader.seek(from);
  ViewingPictures viewing(format);
  PieceEncoder encoder(format);
  Ticks last = 0, usual = 0;
  std::optional<Ticks> following;
  while (std::optional<ArchivedPicture> picture = reader.next()) {
    if (picture->time >= to) {
      following = picture->time;
      break;
    }
    if (picture->time >= from) {
      last = picture->time;
      usual = picture->usual_duration;
    }
    for (const ArchivedPicture& ready : viewing.add(std::move(*picture))) {
      if (ready.time >= from) encoder.add(ready);
    }
  }
  for (const ArchivedPicture& ready : viewing.finish()) {
    if (ready.time >= from) encoder.add(ready);
  }
  if (!following) {
    const auto next = std::find_if(index.segments.begin(), index.segments.end(),
                                   [&](const IndexedSegment& segment) { return segment.start >= to; });
    if (next != index.segments.end()) following = next->start;
  }
  const bool known = following && *following - last <= kLongestPicture;
  return encoder.finish(known ? *following : last + (usual > 0 ? usual : kUnknownDuration),
                        static_cast<std::uint32_t>(number + 1));
}

}  // namespace kiroku::playback
