// A stream of pictures and their audio: the source's thread (source_supervisor.h), a bounded queue, and a
// thread that codes, seals and cuts (segmenter.h) into durable segments.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "recorder/audio_track.h"
#include "recorder/encoder/segment_muxer.h"
#include "recorder/encoder/video_encoder.h"
#include "recorder/frame_queue.h"
#include "recorder/lane.h"
#include "recorder/segmenter.h"
#include "recorder/sound_gaps.h"
#include "recorder/source_supervisor.h"
#include "recorder/stream_output.h"

namespace kiroku::recorder {

class VideoLane : public Lane {
 public:
  /// `source` and `microphone` as SourceSupervisor takes them; the encoder was tried on the source's format.
  VideoLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info,
            SourceSupervisor::Terms terms, std::unique_ptr<Source> source, const VideoProfile& profile,
            std::size_t queue_bytes, std::unique_ptr<Source> microphone = nullptr);
  /// The pictures of another stream, archived a second time: of the same source, which `first` keeps, without
  /// its audio. Constructed before first.start(), from the same thread.
  VideoLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info,
            const VideoLane& first, const VideoProfile& profile, std::size_t queue_bytes);
  ~VideoLane() override;

  /// Whether it is archived a second time, of another stream's source.
  [[nodiscard]] bool is_second() const { return is_second_; }
  /// Called from the lane's thread where pictures cannot be archived in the form that was asked for: they go
  /// on as they were. Given before start().
  using ProfileRefused =
      std::function<void(const std::string& stream, Profile asked, const std::string& why)>;
  void on_profile_refused(ProfileRefused told) { profile_refused_ = std::move(told); }
  /// From the next picture on, with which a segment begins, pictures are archived in that form; those before
  /// it end where it begins. Asked for again and again within seconds, the last one counts, a little later.
  /// Returns at once. Thread-safe.
  void change_profile(Profile profile) { wanted_profile_ = profile; }
  /// What was asked for last, or is in use. Thread-safe.
  [[nodiscard]] Profile wanted_profile() const { return wanted_profile_; }

  void start() override;
  void stop() override { supervisor_->stop(); }
  void finish(std::int64_t close_ns) override;
  [[nodiscard]] bool ended() const override { return supervisor_->ended(); }
  [[nodiscard]] bool reached_end() const override { return supervisor_->reached_end(); }
  [[nodiscard]] bool is_unpaced() const override { return supervisor_->address().unpaced(); }
  void split_at(std::int64_t time_ns) override { split_ns_ = time_ns; }
  [[nodiscard]] bool is_split_at(std::int64_t time_ns) const override {
    return output_.open_since_ns() >= time_ns;
  }
  [[nodiscard]] LaneStatus status() const override;
  [[nodiscard]] const std::string& name() const override { return output_.info().name; }

 private:
  /// Audio as AudioTrack takes it. The supervisor follows.
  struct Audio {
    std::optional<SoundFormat> format;
    bool of_microphone = false;
  };
  VideoLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info,
            const Audio& audio, const VideoProfile& profile, std::size_t queue_bytes, bool is_second);

  void run();
  void join();
  void take(QueuedFrame item);
  void take(QueuedAudio item);
  void take(const SourceLost& lost);
  void take(const AudioLost& lost);
  /// Whether there is an encoder for pictures like these, of which one of `time_ns` is the next; makes one if
  /// not.
  bool ready_for(const PictureFormat& format, Rational rate, std::int64_t time_ns, double bytes_of_picture);
  /// Of pictures that have changed: whether they may, after how often they did.
  bool may_change(const PictureFormat& format, std::int64_t time_ns);
  /// To wanted_profile_, with the picture of `time_ns`.
  void take_profile(const PictureFormat& format, Rational rate, std::int64_t time_ns);
  void record(media::Frame prepared);
  void begin_segment(std::int64_t time_ns, std::int64_t first_pts);
  void seal_in_time(std::int64_t time_ns);
  void end_segment(std::int64_t end_ns);
  /// What is on disk stays, stated as incomplete.
  void give_up_segment();
  void end_coding();
  void forget_encoder();
  /// After what concerns no more than a picture.
  void begin_anew(const media::LibavError& error);
  void state(Gap gap);
  void state_of_audio(const std::optional<Gap>& gap);
  /// Why nothing came since the last frame, until now: that the machine slept explains all the rest.
  [[nodiscard]] archive::GapCause cause_or_sleep(archive::GapCause cause, std::int64_t until_ns) const;
  void state_drops(const QueuedFrame& drops, std::int64_t until_ns);
  void write_audio(std::vector<media::Packet> packets);
  [[nodiscard]] std::int64_t end_of_last_frame() const;
  void report(const std::string& what) const;
  void fail(const std::exception& error);

  const LaneContext context_;
  VideoProfile profile_;  // the coding thread's
  std::atomic<Profile> wanted_profile_, used_profile_;
  ProfileRefused profile_refused_;
  StreamOutput output_;
  FrameQueue queue_;
  std::atomic<std::uint64_t> frames_ = 0, refused_ = 0;
  std::atomic<double> raw_bytes_per_second_ = 0;
  std::atomic<std::int64_t> last_ns_ = 0;  // when the last frame ceased to be shown
  std::atomic<std::int64_t> split_ns_ = INT64_MIN;

  // The coding thread's; finish()'s when that has ended.
  AudioTrack audio_;
  std::optional<SoundGaps> audio_gaps_;  // of a microphone
  Segmenter segmenter_;
  std::unique_ptr<SegmentMuxer> muxer_;
  std::unique_ptr<SegmentMuxer> resting_muxer_;  // of the container that is not in use, if it was
  ChangePace profile_changes_;
  std::unique_ptr<VideoEncoder> encoder_;
  PictureFormat coded_format_;
  std::optional<PictureFormat> refused_format_;
  ChangePace changes_;
  std::optional<std::int64_t> left_out_until_ns_;  // pictures that changed too often
  std::optional<std::int64_t> next_ns_;            // nothing more is recorded before it
  std::int64_t coded_until_ns_ = -1;               // by the encoders before this one
  int failures_in_a_row_ = 0;                      // without a segment that came to its end
  std::uint64_t segment_frames_ = 0, segment_dropped_ = 0;
  std::uint64_t sealed_chunks_ = 0;  // of the segment
  std::int64_t sealed_at_ns_ = 0;    // when there was one more of them
  bool failed_ = false;

  const bool is_second_;
  std::shared_ptr<SourceSupervisor> supervisor_;  // of lanes of one source the same one
  std::thread thread_;
};

}  // namespace kiroku::recorder
