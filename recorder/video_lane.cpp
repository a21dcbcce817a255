#include "recorder/video_lane.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/frame.h>
}

#include <algorithm>
#include <filesystem>

#include "archive/age_layout.h"
#include "base/error.h"

namespace kiroku::recorder {
namespace {

// A segment holds at most 1 GiB (docs/reference/format.md); it is cut well before.
constexpr std::uint64_t kLargestSegmentBytes = 960ULL << 20;
// And at most 10 s, so a silence that would stretch it further is stated as a gap.
constexpr std::int64_t kLongestSegmentNs = 10'000'000'000;
constexpr std::int64_t kLongestSilenceNs = 5'000'000'000;
constexpr std::int64_t kShortestSilenceNs = 1'000'000'000;
constexpr std::int64_t kLongestUnsealedNs = 750'000'000;
constexpr std::int64_t kFirstReopenPauseNs = 1'000'000'000;
constexpr std::int64_t kLongestReopenPauseNs = 16'000'000'000;
constexpr std::chrono::seconds kPipePatience{10};
constexpr int kMostFailuresInARow = 5;

}  // namespace

VideoLane::VideoLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info,
                     SourceAddress address, std::unique_ptr<Source> source, VideoProfile profile,
                     std::size_t queue_bytes, std::shared_ptr<PictureTap> tap,
                     std::shared_ptr<SourceGuard> guard)
    : context_(context),
      address_(std::move(address)),
      profile_(profile),
      tap_(std::move(tap)),
      guard_(std::move(guard)),
      output_(context.store, stream_index, std::move(info), context.facts),
      queue_(queue_bytes),
      muxer_(profile.in_transport_stream() ? make_transport_stream_muxer() : make_matroska_muxer()),
      source_(std::move(source)) {
  if (source_) input_ = source_->input();
  if (!source_ || !profile_.audio) return;
  if (const auto format = source_->sound_format()) sound_ = std::make_unique<SoundEncoder>(*format, profile_);
}

VideoLane::~VideoLane() {
  stop();
  if (capture_thread_.joinable()) capture_thread_.join();
  queue_.finish();
  if (encode_thread_.joinable()) encode_thread_.join();
}

void VideoLane::start() {
  encode_thread_ = std::thread([this] { encode(); });
  capture_thread_ = std::thread([this] { capture(); });
}

void VideoLane::stop() {
  stopping_ = true;
  const std::lock_guard guard(source_mutex_);
  if (source_) source_->interrupt();
}

LaneStatus VideoLane::status() const {
  LaneStatus status;
  status.live = live_;
  status.frames = frames_;
  status.dropped = refused_ + queue_.dropped();
  status.segments = output_.segments();
  status.bytes = output_.bytes();
  status.last_ns = last_ns_;
  status.durable_ns = output_.claimed_until_ns();
  status.stuck = guard_->stuck();
  status.given_up = guard_->given_up();
  const std::lock_guard guard(source_mutex_);
  status.input = input_;
  return status;
}

// --- capture -----------------------------------------------------------------------------------------------

void VideoLane::capture() {
  bool present = source_ != nullptr;
  if (!present) {
    queue_.push(SourceLost{cause_of_loss()});
    present = reopen(false);
  }
  const bool comes_back = present && source_->is_live();
  while (present && !stopping_) {
    bool lost = false;
    try {
      capture_from(*source_);
    } catch (const std::exception& error) {
      context_.troubles.mention(error.what());
      lost = true;
    }
    live_ = false;
    if (!lost || stopping_ || !comes_back) break;  // a damaged file does not come back
    queue_.push(SourceLost{cause_of_loss()});
    // Full teardown, a pause, and a fresh one: stale buffers and half-open connections go with the old
    // object.
    close_source();
    present = reopen(true);
  }
  ended_ = true;
  queue_.finish();
  close_source();
}

void VideoLane::close_source() {
  std::unique_ptr<Source> closing;
  {
    const std::lock_guard guard(source_mutex_);
    closing = std::move(source_);
  }
  // Closing may take its time; stop() must not wait for it.
  closing.reset();
}

void VideoLane::capture_from(Source& source) {
  const Rational rate = source.frame_rate();
  while (std::optional<TimedFrame> frame = source.read()) {
    if (frame->is_sound) {
      if (!context_.end_ns || frame->time_ns < *context_.end_ns) {
        queue_.push(std::move(*frame), address_.unpaced());
      }
      continue;
    }
    if (context_.end_ns && frame->time_ns >= *context_.end_ns) {
      reached_end_ = true;
      return;
    }
    live_ = true;
    frame->rate = rate;
    if (tap_) tap_->offer(*frame);
    queue_.push(std::move(*frame), address_.unpaced());
  }
}

bool VideoLane::reopen(bool was_open) {
  const bool may_end = was_open && address_.kind == SourceKind::kPipe;
  for (std::int64_t pause_ns = kFirstReopenPauseNs;;
       pause_ns = std::min(2 * pause_ns, kLongestReopenPauseNs)) {
    if (!may_end && !wait_until(context_.clock, context_.clock.now_ns() + pause_ns, stopping_)) return false;
    try {
      OpeningTerms terms;
      terms.cancelled = &stopping_;
      terms.sound = profile_.audio;
      terms.guard = guard_;
      if (address_.kind == SourceKind::kPipe) terms.patience = kPipePatience;
      auto fresh = open_source(address_, context_.clock, terms);
      if (const std::string remark = fresh->remark(); !remark.empty()) context_.troubles.mention(remark);
      const std::lock_guard guard(source_mutex_);
      input_ = fresh->input();
      source_ = std::move(fresh);
      if (stopping_) source_->interrupt();
      return true;
    } catch (const std::exception& error) {
      if (stopping_ || may_end) return false;
      context_.troubles.mention(error.what());
    }
  }
}

archive::GapCause VideoLane::cause_of_loss() const {
  std::error_code ignored;
  const bool unplugged =
      address_.kind == SourceKind::kDevice && !std::filesystem::exists(address_.location, ignored);
  return unplugged ? archive::GapCause::kDeviceRemoved : archive::GapCause::kSignalLost;
}

// --- encoding ----------------------------------------------------------------------------------------------

void VideoLane::encode() {
  while (std::optional<QueueItem> item = queue_.pop()) {
    if (failed_) continue;
    try {
      try {
        if (auto* frame = std::get_if<QueuedFrame>(&*item)) {
          take(std::move(*frame));
        } else {
          take(std::get<SourceLost>(*item));
        }
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
  context_.troubles.mention("source '" + address_.stated + "' is taken up anew: " + error.what());
  ++segment_dropped_;
  ++refused_;
  try {
    end_segment(end_of_last_frame());
  } catch (const media::LibavError&) {
    output_.give_up({end_of_last_frame(), segment_frames_, segment_dropped_});
    segment_frames_ = segment_dropped_ = 0;
    recorded_until_ns_ = output_.claimed_until_ns();
  }
  if (!absence_) absence_ = Absence{recorded_until_ns_, archive::GapCause::kInterrupted};
  if (encoder_) forget_encoder();
  muxer_ = profile_.in_transport_stream() ? make_transport_stream_muxer() : make_matroska_muxer();
  failures_in_a_row_ = failures;
  if (failures >= kMostFailuresInARow) refused_format_ = coded_format_;
}

void VideoLane::take(QueuedFrame item) {
  if (item.picture.is_sound) {
    take_sound(std::move(item.picture));
    return;
  }
  const std::int64_t time_ns = item.picture.time_ns;
  segment_dropped_ += item.dropped_before;
  // A short silence lies within a segment; before the first one there is none that could hold it.
  const std::int64_t longest_silence_ns =
      last_frame_ns_ < 0 ? kShortestSilenceNs
                         : std::clamp(kLongestSegmentNs - context_.segment_duration.count(),
                                      kShortestSilenceNs, kLongestSilenceNs);
  if (!absence_ && time_ns - end_of_last_frame() > longest_silence_ns) {
    end_segment(end_of_last_frame());
    absence_ = Absence{recorded_until_ns_,
                       item.dropped_before > 0 ? item.dropped_cause : archive::GapCause::kSignalLost};
  } else if (item.dropped_before > 0) {
    state_gap(item.dropped_since_ns, time_ns, item.dropped_cause);
  }
  if (!ready_for(format_of(*item.picture.frame), item.picture.rate)) {
    ++refused_;
    ++segment_dropped_;
    return;
  }
  if (absence_) {
    state_gap(absence_->since_ns, time_ns, absence_->cause);
    absence_.reset();
  }
  if (media::Frame prepared = encoder_->prepare(std::move(item.picture.frame), time_ns)) {
    record(std::move(prepared));
  }
}

void VideoLane::take_sound(TimedFrame sound) {
  // Where the source came late, its sound is first heard of now; segments carry it from the next one on.
  if (!sound_) sound_ = std::make_unique<SoundEncoder>(sound_format_of(*sound.frame), profile_);
  // Sound stands beside pictures; while there are none, there is nothing to stand beside.
  if (output_.is_open() && segment_has_sound_) {
    write_sound(sound_->encode(std::move(sound.frame), sound.time_ns));
  }
}

void VideoLane::write_sound(std::vector<media::Packet> packets) {
  for (media::Packet& packet : packets) muxer_->write(std::move(packet), 1);
}

void VideoLane::take(const SourceLost& lost) {
  end_coding();
  if (!absence_) absence_ = Absence{recorded_until_ns_, lost.cause};
}

bool VideoLane::ready_for(const PictureFormat& format, Rational rate) {
  if (encoder_ && format == coded_format_) return true;
  if (refused_format_ && format == *refused_format_) return false;
  const bool changed = encoder_ || refused_format_ || (last_frame_ns_ >= 0 && !(format == coded_format_));
  end_coding();
  if (changed) {
    if (!absence_) absence_ = Absence{recorded_until_ns_, archive::GapCause::kFormatChange};
    context_.troubles.mention("source '" + address_.stated + "' changed its pictures to " +
                              format.to_string() + "; recording goes on in a new segment");
  }
  try {
    encoder_ = std::make_unique<VideoEncoder>(format, rate, profile_, coded_until_ns_);
  } catch (const Error& error) {
    // Another format may follow: the other streams, and this one, go on.
    refused_format_ = format;
    context_.troubles.mention("source '" + address_.stated +
                              "' cannot be recorded any more: " + error.what());
    return false;
  }
  refused_format_.reset();
  coded_format_ = format;
  interval_ns_ = encoder_->frame_interval_ns();
  return true;
}

void VideoLane::record(media::Frame prepared) {
  const std::int64_t time_ns = prepared->pts;
  if (output_.is_open() && (time_ns >= boundary_ns_ || output_.open_bytes() >= kLargestSegmentBytes)) {
    end_segment(time_ns);
  }
  const bool first = !output_.is_open();
  media::Packet packet = encoder_->encode(std::move(prepared), first);
  if (first) {
    const MuxedStream muxed = encoder_->muxed_stream();
    const SegmentTime stated = muxer_->stated(packet->pts, muxed.time_base);
    output_.begin(time_ns, stated.pts, stated.time_base);
    boundary_ns_ = next_boundary(time_ns, context_.segment_duration);
    std::vector<MuxedStream> streams{muxed};
    segment_has_sound_ = sound_ != nullptr;
    if (sound_) streams.push_back(sound_->muxed_stream());
    muxer_->begin(streams, [this](ByteView bytes) { output_.write(bytes); });
    sealed_chunks_ = 0;
    sealed_at_ns_ = time_ns;
  }
  muxer_->write(std::move(packet), 0);
  seal_in_time(time_ns);
  last_frame_ns_ = time_ns;
  ++segment_frames_;
  ++frames_;
  last_ns_ = time_ns + interval_ns_;
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
  recorded_until_ns_ = end_ns;
  segment_frames_ = segment_dropped_ = 0;
  failures_in_a_row_ = 0;
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

void VideoLane::state_gap(std::int64_t start_ns, std::int64_t end_ns, archive::GapCause cause) {
  context_.facts.push(
      archive::CaseEntryBody(archive::GapEntry{name(), {std::min(start_ns, end_ns), end_ns}, cause}));
}

std::int64_t VideoLane::end_of_last_frame() const {
  if (last_frame_ns_ < 0) return 0;
  std::int64_t latest = context_.end_ns.value_or(INT64_MAX);
  // What is stamped at arrival cannot last beyond now.
  if (output_.info().timing == "arrival") latest = std::min(latest, context_.clock.now_ns());
  return std::max(std::min(last_frame_ns_ + interval_ns_, latest), last_frame_ns_ + 1);
}

bool VideoLane::is_silent_at(std::int64_t time_ns) const {
  // What states its own times ends where they end.
  return output_.info().timing == "arrival" && !reached_end_ &&
         time_ns - end_of_last_frame() > kShortestSilenceNs;
}

void VideoLane::fail(const std::exception& error) {
  failed_ = true;
  context_.troubles.end_session(close_reason_for(error), error.what());
  try {
    output_.give_up({end_of_last_frame(), segment_frames_, segment_dropped_});
  } catch (const std::exception& second) {
    context_.troubles.mention(second.what());
  }
  absence_ = Absence{output_.claimed_until_ns(), gap_cause_for(error)};
  encoder_.reset();
  queue_.abandon();
  stop();
}

void VideoLane::finish(std::int64_t close_ns) {
  stop();
  if (capture_thread_.joinable()) capture_thread_.join();
  queue_.finish();
  if (encode_thread_.joinable()) encode_thread_.join();
  if (!failed_) {
    try {
      if (const std::optional<QueuedFrame> drops = queue_.unstated_drops()) {
        segment_dropped_ += drops->dropped_before;
        state_gap(drops->dropped_since_ns, std::max(close_ns, drops->dropped_since_ns), drops->dropped_cause);
      }
      if (sound_ && segment_has_sound_ && output_.is_open()) write_sound(sound_->drain());
      end_coding();
      output_.drain();
    } catch (const std::exception& error) {
      fail(error);
    }
  }
  if (last_frame_ns_ < 0 && !absence_) absence_ = Absence{};  // not one frame came
  if (!absence_ && is_silent_at(std::min(close_ns, context_.end_ns.value_or(close_ns))))
    absence_ = Absence{recorded_until_ns_, archive::GapCause::kSignalLost};
  if (absence_) state_gap(absence_->since_ns, std::max(close_ns, absence_->since_ns), absence_->cause);
}

}  // namespace kiroku::recorder
