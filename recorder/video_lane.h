// A stream of pictures: capture thread, bounded queue, encoding and sealing thread, durable segments.
//
// Cutting. A segment ends with the first frame at or after the next whole multiple of the segment duration on
// the case clock, and the next one begins with that frame, so spans join without a hole. It ends early, after
// its last frame, where nothing more can be recorded: the source is lost or silent for long, its pictures
// change their size or pixel format, the disk is full. What follows is a `gap` until the next frame, or until
// the end.
#pragma once

#include <atomic>
#include <memory>
#include <thread>

#include "recorder/encoder/segment_muxer.h"
#include "recorder/encoder/sound_encoder.h"
#include "recorder/encoder/video_encoder.h"
#include "recorder/frame_queue.h"
#include "recorder/lane.h"
#include "recorder/picture_tap.h"
#include "recorder/source/source.h"
#include "recorder/source/source_guard.h"
#include "recorder/stream_output.h"

namespace kiroku::recorder {

class VideoLane : public Lane {
 public:
  /// `source` was opened from `address`, and the encoder was tried on its format; or it is null, and the
  /// source is taken up when it can be opened, with a gap stated until then. A live one is opened anew when
  /// it is lost, after pauses that grow from one second to sixteen, until it is back (a pipe: when somebody
  /// writes to it again within ten seconds, else it has ended). `tap`, which may be null, is offered every
  /// picture before it is queued. The source is opened through `guard`, so that nothing here waits longer for
  /// it than the guard's limits say.
  VideoLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info,
            SourceAddress address, std::unique_ptr<Source> source, VideoProfile profile,
            std::size_t queue_bytes, std::shared_ptr<PictureTap> tap, std::shared_ptr<SourceGuard> guard);
  ~VideoLane() override;

  void start() override;
  void stop() override;
  void finish(std::int64_t close_ns) override;
  [[nodiscard]] bool ended() const override { return ended_; }
  [[nodiscard]] bool reached_end() const override { return reached_end_; }
  [[nodiscard]] bool is_unpaced() const override { return address_.unpaced(); }
  [[nodiscard]] LaneStatus status() const override;
  [[nodiscard]] const std::string& name() const override { return output_.info().name; }

 private:
  // Capture.
  void capture();
  void capture_from(Source& source);
  /// Tries until there is a source; false if it has ended or the session stops. A pipe that was never
  /// opened is waited for like anything else.
  bool reopen(bool may_have_ended);
  void close_source();
  [[nodiscard]] archive::GapCause cause_of_loss() const;

  // Encoding.
  void encode();
  void take(QueuedFrame item);
  void take(const SourceLost& lost);
  void take_sound(TimedFrame sound);
  void write_sound(std::vector<media::Packet> packets);
  /// Whether there is an encoder for pictures like these; makes one if not.
  bool ready_for(const PictureFormat& format, Rational rate);
  void record(media::Frame prepared);
  void seal_in_time(std::int64_t time_ns);
  void end_segment(std::int64_t end_ns);
  void end_coding();
  void forget_encoder();
  /// After what concerns no more than a picture.
  void begin_anew(const media::LibavError& error);
  void state_gap(std::int64_t start_ns, std::int64_t end_ns, archive::GapCause cause);
  /// When the last frame ceased to be shown.
  [[nodiscard]] std::int64_t end_of_last_frame() const;
  /// Whether pictures that could have come until then did not.
  [[nodiscard]] bool is_silent_at(std::int64_t time_ns) const;
  void fail(const std::exception& error);

  /// Nothing has been recorded since then.
  struct Absence {
    std::int64_t since_ns = 0;
    archive::GapCause cause = archive::GapCause::kSignalLost;
  };

  const LaneContext context_;
  const SourceAddress address_;
  const VideoProfile profile_;
  const std::shared_ptr<PictureTap> tap_;
  const std::shared_ptr<SourceGuard> guard_;
  StreamOutput output_;
  FrameQueue queue_;
  std::unique_ptr<SegmentMuxer> muxer_;
  std::unique_ptr<SoundEncoder> sound_;  // null: no sound, or none yet

  mutable std::mutex source_mutex_;  // guards the next two: stop() interrupts whatever source there is
  std::unique_ptr<Source> source_;
  std::string input_;  // of the source there is, or was
  std::atomic<bool> stopping_ = false, ended_ = false, reached_end_ = false, live_ = false;
  std::atomic<std::uint64_t> frames_ = 0, refused_ = 0;
  std::atomic<std::int64_t> last_ns_ = 0;  // when the last frame ceased to be shown

  // The encoding thread's; finish()'s when that has ended.
  std::unique_ptr<VideoEncoder> encoder_;
  PictureFormat coded_format_;
  std::optional<PictureFormat> refused_format_;
  std::int64_t boundary_ns_ = 0, last_frame_ns_ = -1;
  std::int64_t interval_ns_ = 0;
  std::int64_t coded_until_ns_ = -1;    // by the encoders before this one
  int failures_in_a_row_ = 0;           // without a segment that came to its end
  std::int64_t recorded_until_ns_ = 0;  // end of the last segment
  std::uint64_t segment_frames_ = 0, segment_dropped_ = 0;
  std::uint64_t sealed_chunks_ = 0;  // of the segment
  std::int64_t sealed_at_ns_ = 0;    // when there was one more of them
  bool segment_has_sound_ = false;
  std::optional<Absence> absence_;
  bool failed_ = false;

  std::thread capture_thread_, encode_thread_;
};

}  // namespace kiroku::recorder
