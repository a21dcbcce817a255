// A stream of pictures: capture thread, bounded queue, encoding and sealing thread, durable segments.
#pragma once

#include <atomic>
#include <memory>
#include <thread>

#include "recorder/encoder/segment_muxer.h"
#include "recorder/encoder/video_encoder.h"
#include "recorder/frame_queue.h"
#include "recorder/lane.h"
#include "recorder/source/source.h"
#include "recorder/stream_output.h"

namespace kiroku::recorder {

class VideoLane : public Lane {
 public:
  /// `source` was opened from `address`; a live one is opened anew when it is lost. The encoder was tried on
  /// the source's format before.
  VideoLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info,
            SourceAddress address, std::unique_ptr<Source> source, VideoProfile profile,
            std::size_t queue_bytes);
  ~VideoLane() override;

  void start() override;
  void stop() override;
  void finish(std::int64_t close_ns) override;
  [[nodiscard]] bool ended() const override { return ended_; }
  [[nodiscard]] LaneStatus status() const override;
  [[nodiscard]] const std::string& name() const override { return output_.info().name; }

 private:
  /// An encoder and its muxer, for as long as the pictures keep their format.
  struct Coding;

  void capture();
  /// Reads until the source ends; false if it was lost.
  bool capture_from(Source& source);
  void state_interruption(std::int64_t until_ns);
  void encode();
  void take(QueuedFrame item);
  void take(const Interruption& interruption);
  void record(media::Frame prepared);
  void end_segment(std::int64_t end_ns);
  void end_coding(std::int64_t end_ns);
  void fail(const std::exception& error);

  LaneContext context_;
  SourceAddress address_;
  VideoProfile profile_;
  StreamOutput output_;
  FrameQueue queue_;

  std::mutex source_mutex_;  // guards the pointer: stop() interrupts whatever source there is
  std::unique_ptr<Source> source_;
  std::atomic<bool> stopping_ = false, ended_ = false, live_ = false;
  std::atomic<std::uint64_t> frames_ = 0, dropped_ = 0;
  std::atomic<std::int64_t> last_ns_ = 0;

  // The capture thread's.
  std::int64_t captured_until_ns_ = 0;
  std::optional<archive::GapCause> away_;
  std::int64_t away_since_ns_ = 0;

  // The encoding thread's.
  std::unique_ptr<Coding> coding_;
  PictureFormat coded_format_;
  std::int64_t frame_ns_ = 40'000'000;
  std::int64_t boundary_ns_ = 0, last_frame_ns_ = 0;
  std::uint64_t segment_frames_ = 0, segment_dropped_ = 0;
  std::optional<std::int64_t> failed_since_ns_;

  std::thread capture_thread_, encode_thread_;
};

}  // namespace kiroku::recorder
