// Single pictures of a case: thumbnails, and the archived pictures themselves one by one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "base/bytes.h"
#include "viewer/playback/case_media.h"
#include "viewer/playback/picture_reader.h"

namespace kiroku::playback {

/// A JPEG file, 160 pixels wide, of the first key frame in [from, to), or of the last one before where the
/// pictures of that time refer to it; empty where nothing was recorded. Thread-safe. Throws as PictureReader.
Bytes make_thumbnail(const SegmentOpener& media, const VideoIndex& index, Ticks from, Ticks to);

/// Which picture is meant: the last one before the one at a time, the one shown at that time (the last that
/// is not after it), or the first one after it.
enum class Step { kBefore = -1, kAt = 0, kAfter = 1 };

struct ArchivedStill {
  Bytes png;
  std::int64_t time_ns = 0;  // of the case clock
};

/// The archived pictures one by one, forwards and back. Decoded ones are kept, so that steps either way
/// decode nothing twice within a group of pictures. An object belongs to one thread.
class PictureStepper {
 public:
  /// Both must outlive the object.
  PictureStepper(const SegmentOpener& media, const VideoIndex& index);

  /// Nothing where there is no such picture. Valid until the next call. Throws as PictureReader.
  const ArchivedPicture* find(Ticks time, Step step);

 private:
  /// Makes kept_ hold the last picture not after `time`, if there is one, and the picture after it.
  void reach(Ticks time);
  bool decode_next();

  const VideoIndex& index_;
  PictureReader reader_;
  std::deque<ArchivedPicture> kept_;  // neighbours in the stream
  std::size_t kept_bytes_ = 0;
  bool at_end_ = false;  // nothing follows kept_.back()
};

/// The picture as a PNG file: unchanged but for its colour space, sRGB. Thread-safe. Throws kiroku::Error for
/// a pixel format that cannot be shown.
Bytes png_of_archived(const AVFrame& picture);

}  // namespace kiroku::playback
