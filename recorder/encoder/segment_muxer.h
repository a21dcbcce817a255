// Packets into segments: one time line over the whole case, cut where the caller says. One thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/bytes.h"
#include "media/libav_handles.h"

namespace kiroku::recorder {

/// Where a segment's bytes go. May throw: the error comes out of the muxer's function that was called.
using SegmentSink = std::function<void(ByteView)>;

/// Stated of a segment in its ledger entry.
struct SegmentTime {
  std::int64_t pts = 0;
  std::string time_base;  // "1/90000"
};

class SegmentMuxer {
 public:
  virtual ~SegmentMuxer() = default;
  /// The next segment begins; its bytes go to `sink`.
  virtual void begin(SegmentSink sink) = 0;
  /// Takes the packet of stream `stream` (0: pictures, 1: sound), time stamps in that encoder's time base.
  virtual void write(media::Packet packet, int stream) = 0;
  /// Everything of the segment has left through its sink.
  virtual void end() = 0;
  /// How a picture's pts stands in the file.
  [[nodiscard]] virtual SegmentTime stated(std::int64_t encoder_pts) const = 0;
};

/// MPEG-TS: one muxer for the whole case, tables repeated at each segment, so that segments decrypted and
/// concatenated are one clean stream. `encoders`: pictures, then sound if any; they must outlive the muxer.
std::unique_ptr<SegmentMuxer> make_transport_stream_muxer(const std::vector<const AVCodecContext*>& encoders);
/// Matroska: one file a segment, with time stamps of the case; ffmpeg's concat demuxer or `kiroku export`
/// joins them.
std::unique_ptr<SegmentMuxer> make_matroska_muxer(const std::vector<const AVCodecContext*>& encoders);

}  // namespace kiroku::recorder
