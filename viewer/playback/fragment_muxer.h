// H.264 for browsers (ISO 14496-10, High profile, 4:2:0, 8 bit) and the fragments of MP4 (ISO 14496-12, 8.8)
// that carry it or sound, as Media Source Extensions take them. Objects belong to one thread.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "base/bytes.h"
#include "media/libav_handles.h"
#include "viewer/playback/viewing_format.h"

namespace kiroku::playback {

/// `ftyp` and `moov`: goes before the first fragment of a stream.
struct InitSegment {
  Bytes bytes;
  /// RFC 6381: "avc1.640028"; "flac".
  std::string codecs;
};

/// An encoder that gives each picture's packet at once, without reordering, on one thread; key frames only
/// where they are asked for (AV_PICTURE_TYPE_I). Its time base is a tick. `preset` of x264: "superfast",
/// "ultrafast".
media::Codec make_viewing_encoder(const ViewingFormat& format, const char* preset);

/// A track whose header is written, and its fragments.
class FragmentMuxer {
 public:
  /// `sequence_number` as of `mfhd`, of the first fragment.
  FragmentMuxer(const AVCodecContext& encoder, std::uint32_t sequence_number);
  ~FragmentMuxer();
  FragmentMuxer(const FragmentMuxer&) = delete;
  FragmentMuxer& operator=(const FragmentMuxer&) = delete;

  [[nodiscard]] const InitSegment& init() const { return init_; }
  /// Its `pts` on the case clock, and its duration, must be set: in ticks, or of sound in samples.
  void write(AVPacket& packet);
  /// What was written becomes one fragment: `moof` and `mdat`, decode times (`tfdt`) in the same unit of the
  /// case clock.
  Bytes fragment();

 private:
  class Output;
  media::OutputContext context_;
  std::unique_ptr<Output> output_;
  InitSegment init_;
};

}  // namespace kiroku::playback
