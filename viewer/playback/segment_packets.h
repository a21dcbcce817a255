// Packets of one segment on the case clock. An object belongs to one thread.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>

#include "media/libav_handles.h"
#include "media/segment_input.h"
#include "viewer/playback/case_media.h"

struct AVStream;

namespace kiroku::playback {

/// Pictures and sound of a segment stand on one muxer time line, and the first picture's place on the case
/// clock is known (IndexedSegment::start); from it follows that of everything else.
class SegmentPackets {
 public:
  enum class Of { kPictures, kSound };

  /// `segment` is one of `index`; nothing is kept of the three. Throws as SegmentOpener and
  /// media::SegmentInput, and media::MediaError where pictures are asked for and there are none.
  SegmentPackets(const SegmentOpener& media, const VideoIndex& index, const IndexedSegment& segment,
                 Of which);
  SegmentPackets(const SegmentPackets&) = delete;
  SegmentPackets& operator=(const SegmentPackets&) = delete;

  /// Of the packets; null where sound was asked for and the segment has no track for it.
  [[nodiscard]] const AVStream* stream() const { return stream_; }
  /// The next packet in the order of the file, pts and duration in ticks, the pts of the case clock; null at
  /// the end. Throws media::MediaError for damage, except where a segment was cut off: there it ends.
  media::Packet next();

 private:
  [[nodiscard]] bool read(AVPacket& packet);
  void begin_at(Ticks stamp);
  /// The next packet of the stream or of the pictures, its pts still the container's, in ticks.
  media::Packet next_of_both();

  bool wraps_, tolerate_cut_;
  std::unique_ptr<crypto::ByteSource> plaintext_;
  media::SegmentInput input_;
  const AVStream* pictures_;
  const AVStream* stream_;
  Ticks start_;                  // of the first picture
  std::optional<Ticks> offset_;  // where that is an estimate
  std::optional<Ticks> first_stamp_;
  std::deque<media::Packet> early_;  // up to the first picture
};

}  // namespace kiroku::playback
