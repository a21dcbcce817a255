// The archived pictures of a stream, decoded in order, each with its time on the case clock. An object
// belongs to one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

#include "media/libav_handles.h"
#include "viewer/playback/case_media.h"

namespace kiroku::playback {

struct ArchivedPicture {
  media::Frame frame;  // as it was decoded: pixel format, fields, colours untouched; its pts is `time`
  Ticks time = 0;
  /// The usual distance to the next picture where it is known, else 0.
  Ticks usual_duration = 0;
};

/// What a reader decodes.
enum class Decoding { kEveryPicture, kKeyFramesOnly };

class PictureReader {
 public:
  /// Both must outlive the object. `threads` as of media::PictureDecoder.
  PictureReader(const SegmentOpener& media, const VideoIndex& index,
                Decoding decoding = Decoding::kEveryPicture, int threads = 1);
  ~PictureReader();
  PictureReader(const PictureReader&) = delete;
  PictureReader& operator=(const PictureReader&) = delete;

  /// next() gives the last key frame at or before `time`, or the stream's first picture where there is none.
  /// (Within the segment that `time` is in, or the last before it: segments decode alone.)
  /// Returns the time of the first picture after `time` in that segment, if there is one.
  std::optional<Ticks> seek(Ticks time);
  /// Segments that begin at or after `time` are not opened: next() gives nothing then. For all times to come
  /// until it is set anew.
  void stop_before(Ticks time) { stop_ = time; }
  /// The next picture, or nothing at the stream's end; times strictly increase. Over a gap it goes on with
  /// what follows. A segment that was being written when the recorder died gives its pictures up to the first
  /// that is not whole. Throws kiroku::Error: a segment that is not what the ledger says or cannot be opened
  /// (media::SealedSegment::open), damaged media; the next call goes on with the segment after it.
  std::optional<ArchivedPicture> next();

 private:
  struct Open;

  /// False past the last segment.
  bool open(std::size_t segment);

  const SegmentOpener& media_;
  const VideoIndex& index_;
  Decoding decoding_;
  int threads_;
  Ticks stop_ = INT64_MAX;
  std::size_t next_segment_ = 0;
  std::unique_ptr<Open> open_;
  std::optional<Ticks> last_;
};

}  // namespace kiroku::playback
