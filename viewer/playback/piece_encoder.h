// Pictures into pieces of a viewing copy (fragment_muxer.h). An object makes one piece and belongs to one
// thread; make_init_segment() is thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "base/bytes.h"
#include "media/libav_handles.h"
#include "viewer/playback/fragment_muxer.h"
#include "viewer/playback/picture_reader.h"
#include "viewer/playback/viewing_format.h"

namespace kiroku::playback {

/// What goes before the first piece of a stream, whichever that is.
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
