// Packets into segments: one time line over the whole case, cut where the caller says. One thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/bytes.h"
#include "media/libav_handles.h"
#include "recorder/source/source.h"

namespace kiroku::recorder {

/// Where a segment's bytes go. May throw: the error comes out of the muxer's function that was called.
using SegmentSink = std::function<void(ByteView)>;

/// Stated of a segment in its ledger entry.
struct SegmentTime {
  std::int64_t pts = 0;
  std::string time_base;  // "1/90000"
};

/// What a muxer must know of a stream. The encoder is borrowed; it states codec and picture or sound format.
struct MuxedStream {
  const AVCodecContext* encoder = nullptr;
  Rational time_base;  // of its packets
};

/// Packets of one archived stream into one segment after the other. An error in one function leaves the
/// object good for destruction only.
class SegmentMuxer {
 public:
  virtual ~SegmentMuxer() = default;
  /// The next segment begins; its bytes go to `sink` until end(). `streams`: pictures, then sound if any;
  /// their number stays the same, their encoders may be others than last time, and need to live during this
  /// call only.
  virtual void begin(const std::vector<MuxedStream>& streams, SegmentSink sink) = 0;
  /// Takes a packet of stream `stream` (0: pictures, 1: sound), time stamps in that stream's time base.
  virtual void write(media::Packet packet, int stream) = 0;
  /// Adds what every reader skips until more than a whole number of `unit` bytes of the segment have left
  /// through its sink, so that a sealer of chunks of that size lets go of everything before. Nothing where
  /// the container has no such filling.
  virtual void fill_up(std::uint64_t unit) = 0;
  /// Everything of the segment has left through its sink.
  virtual void end() = 0;
  /// How a packet's pts in `time_base` stands in the file.
  [[nodiscard]] virtual SegmentTime stated(std::int64_t pts, Rational time_base) const = 0;
};

/// MPEG-TS: one muxer for the whole case, tables repeated at each segment, so that segments decrypted and
/// concatenated are one clean stream. Its time stamps wrap after 26.5 hours (33 bits), the stated ones do
/// not.
std::unique_ptr<SegmentMuxer> make_transport_stream_muxer();
/// Matroska: one file a segment, with time stamps of the case; ffmpeg's concat demuxer or `kiroku export`
/// joins them.
std::unique_ptr<SegmentMuxer> make_matroska_muxer();

}  // namespace kiroku::recorder
