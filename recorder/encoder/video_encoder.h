// Pictures to packets of the archived form. One thread.
#pragma once

#include <cstdint>
#include <memory>

#include "media/libav_handles.h"
#include "recorder/encoder/frame_filter.h"
#include "recorder/encoder/segment_muxer.h"
#include "recorder/encoder/video_profile.h"
#include "recorder/source/source.h"

namespace kiroku::recorder {

/// An encoder for one picture format. Every picture gives exactly one packet, at once: none is held back or
/// reordered, so that a segment can begin with any picture.
///
/// Time stamps. A packet carries the case-clock time of its picture, rounded to the container's unit (1/90000
/// s in MPEG-TS, 1/1000 s in Matroska); nothing is counted up from the nominal frame rate, so nothing drifts.
/// Two exceptions keep files playable: pictures that arrived in a burst are spread to half the nominal frame
/// interval, and time stamps strictly increase.
class VideoEncoder {
 public:
  /// Throws kiroku::UsageError for a picture that the profile cannot hold (too large, a pixel format without
  /// a name in Matroska, …).
  /// Its first picture is coded after `after_ns`, where an encoder before it ended: a stream has one time
  /// line whatever pictures it had. -1 if there was none.
  VideoEncoder(const PictureFormat& format, Rational frame_rate, const VideoProfile& profile,
               std::int64_t after_ns = -1);

  /// The picture as the encoder takes it (pixel format, deinterlaced), its `pts` being `time_ns` of the case
  /// clock. Null while a deinterlacer waits for the next picture; what comes out then is the earlier one,
  /// with its own time.
  media::Frame prepare(media::Frame frame, std::int64_t time_ns);
  /// What a deinterlacer still holds; null when nothing.
  media::Frame drain();
  /// Encodes a prepared picture, as a key frame if `first_of_segment`.
  media::Packet encode(media::Frame prepared, bool first_of_segment);

  /// For the muxer; valid as long as this object.
  [[nodiscard]] MuxedStream muxed_stream() const { return {codec_.get(), time_base_}; }
  /// The nominal time between two pictures.
  [[nodiscard]] std::int64_t frame_interval_ns() const { return interval_ns_; }
  /// The time that the last picture was coded at: its own, or later where pictures came in a burst.
  [[nodiscard]] std::int64_t coded_until_ns() const { return last_time_ns_; }

 private:
  void open_mpeg2(const PictureFormat& format, Rational frame_rate, const VideoProfile& profile);
  void open_uncompressed(const PictureFormat& format, Rational frame_rate);
  void open_lossless(const PictureFormat& format, Rational frame_rate);
  [[nodiscard]] std::int64_t pts_of(std::int64_t time_ns);
  [[nodiscard]] std::int64_t rescaled(std::int64_t time_ns) const;  // to the time base

  std::unique_ptr<FrameFilter> filter_;
  media::Codec codec_;
  Rational time_base_;
  std::int64_t interval_ns_;
  std::int64_t last_time_ns_;
  std::int64_t last_pts_;
};

}  // namespace kiroku::recorder
