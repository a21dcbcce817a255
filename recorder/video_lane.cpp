#include "recorder/video_lane.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/frame.h>
}

#include <algorithm>
#include <utility>

#include "archive/format/age_layout.h"
#include "base/error.h"
#include "recorder/source/sound_source.h"

namespace kiroku::recorder {
namespace {

constexpr std::int64_t kLongestUnsealedNs = 750'000'000;
constexpr int kMostFailuresInARow = 5;

std::unique_ptr<SegmentMuxer> make_muxer(const VideoProfile& profile) {
  return profile.in_transport_stream() ? make_transport_stream_muxer() : make_matroska_muxer();
}

/// A microphone's is known before it is there, so that the first segment has room for it.
std::optional<SoundFormat> audio_format(const SourceSupervisor::Terms& terms, const Source* source) {
  if (terms.microphone) return sound_format_asked(*terms.microphone);
  return source == nullptr ? std::nullopt : source->sound_format();
}

VideoProfile with_audio(VideoProfile profile) {
  profile.audio = true;
  return profile;
}

}  // namespace

VideoLane::VideoLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info,
                     const Audio& audio, const VideoProfile& profile, std::size_t queue_bytes, bool is_second)
    : context_(context),
      profile_(profile),
      wanted_profile_(profile.profile),
      used_profile_(profile.profile),
      output_(context.store, stream_index, std::move(info), context.facts),
      queue_(queue_bytes),
      audio_(audio.format, audio.of_microphone ? with_audio(profile) : profile,
             audio.of_microphone ? SoundEncoder::Pace::kResampled : SoundEncoder::Pace::kAsTheyCome),
      audio_gaps_(audio.of_microphone ? std::optional(SoundGaps()) : std::nullopt),
      segmenter_({.duration = context.segment_duration,
                  .end_ns = context.end_ns,
                  .timed_by_arrival = output_.info().timing == "arrival"}),
      muxer_(make_muxer(profile)),
      is_second_(is_second) {}

VideoLane::VideoLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info,
                     SourceSupervisor::Terms terms, std::unique_ptr<Source> source,
                     const VideoProfile& profile, std::size_t queue_bytes, std::unique_ptr<Source> microphone)
    : VideoLane(context, stream_index, std::move(info),
                {audio_format(terms, source.get()), terms.microphone.has_value()}, profile, queue_bytes,
                false) {
  supervisor_ = std::make_shared<SourceSupervisor>(context_, std::move(terms), std::move(source), queue_,
                                                   std::move(microphone));
}

VideoLane::VideoLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info,
                     const VideoLane& first, const VideoProfile& profile, std::size_t queue_bytes)
    : VideoLane(context, stream_index, std::move(info), {}, profile, queue_bytes, true) {
  first.supervisor_->feed_also(queue_);
  supervisor_ = first.supervisor_;
}

VideoLane::~VideoLane() {
  if (!supervisor_) return;  // its construction failed
  stop();
  join();
}

void VideoLane::start() {
  thread_ = std::thread([this] { run(); });
  if (!is_second_) supervisor_->start();
}

LaneStatus VideoLane::status() const {
  LaneStatus status;
  status.live = supervisor_->live();
  status.frames = frames_;
  status.dropped = refused_ + queue_.dropped();
  status.segments = output_.segments();
  status.bytes = output_.bytes();
  status.last_ns = last_ns_;
  status.durable_ns = output_.claimed_until_ns();
  // Counted once, where the source is kept.
  status.stuck = is_second_ ? 0 : supervisor_->stuck();
  status.given_up = is_second_ ? 0 : supervisor_->given_up();
  status.input = supervisor_->input();
  status.unboxed = supervisor_->is_unboxed();
  const Profile used = used_profile_, wanted = wanted_profile_;
  status.profile = profile_name(used);
  if (wanted != used) status.profile_to_come = profile_name(wanted);
  status.raw_bytes_per_second = raw_bytes_per_second_;
  return status;
}

void VideoLane::join() {
  supervisor_->join();
  queue_.finish();
  if (thread_.joinable()) thread_.join();
}

void VideoLane::run() {
  while (std::optional<QueueItem> item = queue_.pop()) {
    if (failed_) continue;
    try {
      try {
        std::visit([this](auto&& each) { take(std::forward<decltype(each)>(each)); }, std::move(*item));
      } catch (const media::LibavError& error) {
        begin_anew(error);
      }
    } catch (const std::exception& error) {
      fail(error);
    }
  }
}

// What libav refuses concerns one picture of one stream, and must end neither the stream nor the case: all
// that coded it goes, and the next picture meets a new encoder in a new segment. What it refuses again and
// again is left out until the source changes its pictures.
void VideoLane::begin_anew(const media::LibavError& error) {
  const int failures = failures_in_a_row_ + 1;
  report(std::string("is taken up anew: ") + error.what());
  ++segment_dropped_;
  ++refused_;
  try {
    end_segment(end_of_last_frame());
  } catch (const media::LibavError&) {
    give_up_segment();
    segmenter_.segment_ended(output_.claimed_until_ns());
  }
  segmenter_.absent(archive::GapCause::kInterrupted);
  if (encoder_) forget_encoder();
  muxer_ = make_muxer(profile_);
  failures_in_a_row_ = failures;
  if (failures >= kMostFailuresInARow) refused_format_ = coded_format_;
}

void VideoLane::take(QueuedFrame item) {
  const std::int64_t time_ns = item.frame.time_ns;
  next_ns_ = time_ns;
  if (audio_gaps_) state_of_audio(audio_gaps_->piece_before(time_ns));
  segment_dropped_ += item.dropped_before;
  const archive::GapCause cause =
      cause_or_sleep(item.dropped_before > 0 ? item.dropped_cause : archive::GapCause::kSignalLost, time_ns);
  if (cause == archive::GapCause::kSuspended || segmenter_.silent_before(time_ns, context_.clock.now_ns())) {
    end_segment(end_of_last_frame());
    segmenter_.absent(cause);
  } else if (item.dropped_before > 0) {
    state_drops(item, time_ns);
  }
  const PictureFormat format = format_of(*item.frame.frame);
  if (wanted_profile_ != profile_.profile) take_profile(format, item.frame.rate, time_ns);
  const auto bytes_of_picture = static_cast<double>(frame_bytes(*item.frame.frame));
  if (!ready_for(format, item.frame.rate, time_ns, bytes_of_picture)) {
    ++refused_;
    ++segment_dropped_;
    return;
  }
  if (const std::optional<Gap> gap = segmenter_.gap_before(time_ns)) state(*gap);
  if (media::Frame prepared = encoder_->prepare(std::move(item.frame.frame), time_ns)) {
    record(std::move(prepared));
  }
}

void VideoLane::take(QueuedAudio item) {
  if (audio_gaps_) {
    const AVFrame& audio = *item.audio.frame;
    const std::int64_t start_ns = item.audio.time_ns;
    if (audio_gaps_->leaves_out(start_ns)) return;
    state_of_audio(
        audio_gaps_->heard(start_ns, start_ns + audio.nb_samples * 1'000'000'000LL / audio.sample_rate));
  }
  write_audio(audio_.take(std::move(item.audio)));
}

void VideoLane::take(const AudioLost& lost) {
  if (audio_gaps_) audio_gaps_->lost(lost.cause);
}

void VideoLane::take(const SourceLost& lost) {
  next_ns_ = lost.time_ns;
  end_coding();
  segmenter_.absent(cause_or_sleep(lost.cause, context_.clock.now_ns()));
}

archive::GapCause VideoLane::cause_or_sleep(archive::GapCause cause, std::int64_t until_ns) const {
  if (output_.info().timing != "arrival") return cause;
  const std::int64_t since_ns = segmenter_.has_frames() ? segmenter_.last_frame_ns() : 0;
  const bool slept = context_.sleeps.slept_within(since_ns, until_ns);
  return slept ? archive::GapCause::kSuspended : cause;
}

void VideoLane::write_audio(std::vector<media::Packet> packets) {
  for (media::Packet& packet : packets) muxer_->write(std::move(packet), 1);
}

// A camera that flickers between two sizes would else make a thousand files a second. What it sends while it
// changes too often is left out, as a gap.
bool VideoLane::may_change(const PictureFormat& format, std::int64_t time_ns) {
  left_out_until_ns_ = changes_.refused_until(time_ns);
  if (!left_out_until_ns_) return true;
  report("changed its pictures to " + format.to_string() + ", after " +
         std::to_string(ChangePace::kMostChanges) + " other changes within " +
         std::to_string(ChangePace::kWithinNs / 1'000'000'000) +
         " s; what it sends is left out for a while: look at the camera and what lies between");
  return false;
}

bool VideoLane::ready_for(const PictureFormat& format, Rational rate, std::int64_t time_ns,
                          double bytes_of_picture) {
  if (encoder_ && format == coded_format_) return true;
  if (left_out_until_ns_ && time_ns < *left_out_until_ns_) return false;
  if (refused_format_ && format == *refused_format_) return false;
  const bool changed = encoder_ || refused_format_ || left_out_until_ns_ ||
                       (segmenter_.has_frames() && !(format == coded_format_));
  end_coding();
  if (changed) {
    segmenter_.absent(archive::GapCause::kFormatChange);
    if (!may_change(format, time_ns)) return false;
    report("changed its pictures to " + format.to_string() + "; recording goes on in a new segment");
  }
  try {
    encoder_ = std::make_unique<VideoEncoder>(format, rate, profile_, coded_until_ns_);
  } catch (const Error& error) {
    // Another format may follow: the other streams, and this one, go on.
    refused_format_ = format;
    report(std::string("cannot be recorded any more: ") + error.what());
    return false;
  }
  refused_format_.reset();
  coded_format_ = format;
  raw_bytes_per_second_ = bytes_of_picture * 1e9 / static_cast<double>(encoder_->frame_interval_ns());
  return true;
}

// Tried first, so that what cannot hold these pictures costs none of them.
void VideoLane::take_profile(const PictureFormat& format, Rational rate, std::int64_t time_ns) {
  if (profile_changes_.refused_until(time_ns)) return;  // asked for again with the next picture
  Profile wanted = wanted_profile_;
  VideoProfile changed = profile_;
  changed.profile = wanted;
  try {
    const VideoEncoder tried(format, rate, changed);
  } catch (const Error& error) {
    wanted_profile_.compare_exchange_strong(wanted, profile_.profile);
    report("goes on as " + std::string(profile_name(profile_.profile)) + ": " + error.what());
    if (profile_refused_) profile_refused_(name(), changed.profile, error.what());
    return;
  }
  if (encoder_) {
    while (media::Frame held = encoder_->drain()) record(std::move(held));
    write_audio(audio_.drain());
    end_segment(time_ns);
    forget_encoder();
  }
  if (changed.in_transport_stream() != profile_.in_transport_stream()) {
    std::swap(muxer_, resting_muxer_);
    if (!muxer_) muxer_ = make_muxer(changed);
  }
  audio_.change_profile(changed.profile);
  // What one form cannot hold another may.
  refused_format_.reset();
  profile_ = changed;
  used_profile_ = changed.profile;
}

void VideoLane::record(media::Frame prepared) {
  const std::int64_t time_ns = prepared->pts;
  const bool splits = time_ns >= split_ns_ && output_.open_since_ns() < split_ns_;
  if (output_.is_open() && (splits || segmenter_.cuts_at(time_ns, output_.open_bytes())))
    end_segment(time_ns);
  const bool first = !output_.is_open();
  media::Packet packet = encoder_->encode(std::move(prepared), first);
  if (first) begin_segment(time_ns, packet->pts);
  muxer_->write(std::move(packet), 0);
  seal_in_time(time_ns);
  segmenter_.frame_recorded(time_ns, encoder_->frame_interval_ns());
  ++segment_frames_;
  ++frames_;
  last_ns_ = time_ns + std::min(encoder_->frame_interval_ns(), kLongestShownNs);
}

void VideoLane::begin_segment(std::int64_t time_ns, std::int64_t first_pts) {
  const MuxedStream pictures = encoder_->muxed_stream();
  const SegmentTime stated = muxer_->stated(first_pts, pictures.time_base);
  output_.begin(time_ns, stated.pts, stated.time_base, profile_name(profile_.profile));
  segmenter_.segment_began(time_ns);
  std::vector<MuxedStream> streams{pictures};
  if (const std::optional<MuxedStream> audio = audio_.begin_segment()) streams.push_back(*audio);
  muxer_->begin(streams, [this](ByteView bytes) { output_.write(bytes); });
  sealed_chunks_ = 0;
  sealed_at_ns_ = time_ns;
}

// Ciphertext leaves in chunks, and a chunk that is not full dies with the program: of pictures that need few
// bits it would be seconds.
void VideoLane::seal_in_time(std::int64_t time_ns) {
  if (time_ns - sealed_at_ns_ >= kLongestUnsealedNs) muxer_->fill_up(archive::kAgeChunkBytes);
  const std::uint64_t chunks = output_.open_bytes() / archive::kAgeChunkBytes;
  if (chunks == sealed_chunks_) return;
  sealed_chunks_ = chunks;
  sealed_at_ns_ = time_ns;
}

void VideoLane::end_segment(std::int64_t end_ns) {
  if (!output_.is_open()) return;
  muxer_->end();
  output_.end({end_ns, segment_frames_, segment_dropped_});
  audio_.end_segment();
  segmenter_.segment_ended(end_ns);
  segment_frames_ = segment_dropped_ = 0;
  failures_in_a_row_ = 0;
}

void VideoLane::give_up_segment() {
  audio_.end_segment();
  output_.give_up({end_of_last_frame(), segment_frames_, segment_dropped_});
  segment_frames_ = segment_dropped_ = 0;
}

void VideoLane::end_coding() {
  if (!encoder_) return;
  while (media::Frame held = encoder_->drain()) record(std::move(held));
  end_segment(end_of_last_frame());
  forget_encoder();
}

void VideoLane::forget_encoder() {
  coded_until_ns_ = encoder_->coded_until_ns();
  encoder_.reset();
}

void VideoLane::state(Gap gap) {
  context_.facts.push(archive::CaseEntryBody(archive::GapEntry{name(), gap.span, gap.cause}));
}

void VideoLane::state_of_audio(const std::optional<Gap>& gap) {
  if (!gap) return;
  context_.facts.push(archive::CaseEntryBody(archive::GapEntry{name(), gap->span, gap->cause, true}));
}

void VideoLane::state_drops(const QueuedFrame& drops, std::int64_t until_ns) {
  state({{std::min(drops.dropped_since_ns, until_ns), until_ns}, drops.dropped_cause});
}

std::int64_t VideoLane::end_of_last_frame() const {
  return segmenter_.end_of_last_frame(context_.clock.now_ns(), next_ns_);
}

void VideoLane::report(const std::string& what) const {
  context_.problems.report("source '" + supervisor_->address().stated + "' " + what);
}

void VideoLane::fail(const std::exception& error) {
  failed_ = true;
  next_ns_.reset();
  context_.problems.end_session(close_reason_for(error), error.what());
  try {
    give_up_segment();
  } catch (const std::exception& second) {
    context_.problems.report(second.what());
  }
  segmenter_.failed(output_.claimed_until_ns(), gap_cause_for(error));
  encoder_.reset();
  queue_.abandon();
  stop();
}

void VideoLane::finish(std::int64_t close_ns) {
  stop();
  join();
  if (!failed_) {
    next_ns_.reset();
    try {
      if (const std::optional<QueuedFrame> drops = queue_.unstated_drops()) {
        segment_dropped_ += drops->dropped_before;
        state_drops(*drops, std::max(close_ns, drops->dropped_since_ns));
      }
      write_audio(audio_.drain());
      end_coding();
      output_.drain();
    } catch (const std::exception& error) {
      fail(error);
    }
  }
  if (cause_or_sleep(archive::GapCause::kSignalLost, close_ns) == archive::GapCause::kSuspended) {
    segmenter_.absent(archive::GapCause::kSuspended);
  }
  const std::optional<Gap> rest =
      segmenter_.gap_at_close(close_ns, context_.clock.now_ns(), supervisor_->reached_end());
  if (rest) state(*rest);
  if (audio_gaps_) state_of_audio(audio_gaps_->gap_at_close(close_ns));
}

}  // namespace kiroku::recorder
