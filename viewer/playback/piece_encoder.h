// Pictures into pieces of a viewing copy: H.264 (ISO 14496-10, High profile, 4:2:0, 8 bit) in fragments of
// MP4 (ISO 14496-12, 8.8), as Media Source Extensions take them. An object makes one piece and belongs to one
// thread; make_init_segment() is thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/bytes.h"
#include "media/libav_handles.h"
#include "viewer/playback/picture_reader.h"
#include "viewer/playback/viewing_format.h"

namespace kiroku::playback {

/// `ftyp` and `moov`: goes before the first piece of a stream, whichever that is.
struct InitSegment {
  Bytes bytes;
  /// RFC 6381: "avc1.640028".
  std::string codecs;
};
InitSegment make_init_segment(const ViewingFormat& format);

class PieceEncoder {
 public:
  explicit PieceEncoder(const ViewingFormat& format);

  /// A picture as ViewingPictures makes it, later than the one before. The first one, and the first of each
  /// second of the case clock, is a key frame (IDR); no picture refers to one before it.
  void add(const ArchivedPicture& picture);
  /// The piece: `moof` and `mdat`, decode times (`tfdt`) in ticks of the case clock. Each picture lasts until
  /// the next, the last one until `end`. `sequence_number` as of `mfhd`. Empty if there was no picture.
  Bytes finish(Ticks end, std::uint32_t sequence_number);
  [[nodiscard]] std::size_t pictures() const { return packets_.size(); }

 private:
  void receive();

  media::Codec codec_;
  std::vector<media::Packet> packets_;
  Ticks last_ = 0;
};

}  // namespace kiroku::playback
