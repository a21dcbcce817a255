// Sound to packets that stand beside the pictures: MPEG-1 layer II in MPEG-TS, FLAC (16 or 24 bit) in
// Matroska. One thread.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "media/libav_handles.h"
#include "recorder/encoder/segment_muxer.h"
#include "recorder/encoder/video_profile.h"
#include "recorder/source/source.h"

struct AVFilterContext;

namespace kiroku::recorder {

/// What is coded stays the same over the whole case: 48 kHz for layer II, the first source's own rate for
/// FLAC, one or two channels. Sound that comes in another form later is converted to it; silence fills holes.
class SoundEncoder {
 public:
  /// Throws kiroku::Error if libavcodec cannot encode it.
  SoundEncoder(const SoundFormat& format, const VideoProfile& profile);

  /// Takes decoded sound whose first sample belongs to `time_ns` of the case clock; returns the packets that
  /// are complete, none often.
  std::vector<media::Packet> encode(media::Frame sound, std::int64_t time_ns);
  /// What was not a whole packet yet. Nothing may follow.
  std::vector<media::Packet> drain();

  /// For the muxer; valid as long as this object.
  [[nodiscard]] MuxedStream muxed_stream() const;

 private:
  void build_filter(const AVFrame& sound);
  void take_from_filter(std::vector<media::Packet>& packets);
  void take_from_encoder(const AVFrame* sound, std::vector<media::Packet>& packets);

  media::Codec codec_;
  media::FilterGraph graph_;
  AVFilterContext* source_ = nullptr;
  AVFilterContext* sink_ = nullptr;
  SoundFormat filtered_format_;
  std::int64_t next_pts_ = INT64_MIN;  // in samples
};

}  // namespace kiroku::recorder
