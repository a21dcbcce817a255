// Pictures to packets of the archived form. One thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "media/libav_handles.h"
#include "recorder/encoder/frame_filter.h"
#include "recorder/encoder/video_profile.h"
#include "recorder/source/source.h"

namespace kiroku::recorder {

/// An encoder for one picture format. Every picture gives exactly one packet, at once: none is held back or
/// reordered, so that a segment can begin with any picture.
class VideoEncoder {
 public:
  /// Throws kiroku::UsageError for a picture that the profile cannot hold (too large, a pixel format without
  /// a name in Matroska, …).
  VideoEncoder(const PictureFormat& format, Rational frame_rate, const VideoProfile& profile);

  /// The picture as the encoder takes it (pixel format, deinterlaced), its `pts` being `time_ns` of the case
  /// clock. Null while a deinterlacer waits for the next picture; what comes out then is the earlier one,
  /// with its own time.
  media::Frame prepare(media::Frame frame, std::int64_t time_ns);
  /// What a deinterlacer still holds; null when nothing.
  media::Frame drain();
  /// Encodes a prepared picture, as a key frame if `first_of_segment`. The packet's pts and dts are in
  /// context().time_base.
  media::Packet encode(media::Frame prepared, bool first_of_segment);

  [[nodiscard]] const AVCodecContext& context() const { return *codec_; }

 private:
  [[nodiscard]] std::int64_t pts_of(std::int64_t time_ns);

  std::unique_ptr<FrameFilter> filter_;
  media::Codec codec_;
  std::int64_t last_pts_ = -1;
};

}  // namespace kiroku::recorder
