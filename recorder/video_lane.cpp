#include "recorder/video_lane.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/frame.h>
}

#include <algorithm>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

// A segment holds at most 1 GiB (docs/format.md); it is cut well before.
constexpr std::uint64_t kLargestSegmentBytes = 960ULL << 20;
constexpr std::chrono::milliseconds kReopenPause{1000};

}  // namespace

struct VideoLane::Coding {
  Coding(const PictureFormat& format, Rational rate, const VideoProfile& profile)
      : encoder(format, rate, profile),
        muxer(profile.in_transport_stream() ? make_transport_stream_muxer({&encoder.context()})
                                            : make_matroska_muxer({&encoder.context()})) {}
  VideoEncoder encoder;
  std::unique_ptr<SegmentMuxer> muxer;
};

VideoLane::VideoLane(const LaneContext& context, std::size_t stream_index, archive::StreamInfo info,
                     SourceAddress address, std::unique_ptr<Source> source, VideoProfile profile,
                     std::size_t queue_bytes)
    : context_(context),
      address_(std::move(address)),
      profile_(profile),
      output_(context.writer, stream_index, std::move(info), context.facts),
      queue_(queue_bytes),
      source_(std::move(source)) {}

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
  return {live_, frames_, dropped_ + queue_.dropped(), output_.segments(), output_.bytes(), last_ns_};
}

// --- capture
// ------------------------------------------------------------------------------------------------------------

void VideoLane::capture() {
  const bool is_live = source_->is_live();
  for (;;) {
    bool lost = false;
    try {
      lost = source_ == nullptr || !capture_from(*source_);
    } catch (const std::exception& error) {
      context_.troubles.mention(error.what());
      lost = true;
    }
    live_ = false;
    if (stopping_ || !lost) break;
    if (!away_) {
      away_ = archive::GapCause::kSignalLost;
      away_since_ns_ = captured_until_ns_;
    }
    if (!is_live) break;  // a damaged file does not come back
    // Full teardown, a pause, and a fresh one: stale buffers and half-open connections are gone with the old
    // object.
    {
      const std::lock_guard guard(source_mutex_);
      source_.reset();
    }
    if (!wait_until(context_.clock, context_.clock.now_ns() + std::chrono::nanoseconds(kReopenPause).count(),
                    stopping_))
      break;
    try {
      auto fresh = open_source(address_, context_.clock);
      const std::lock_guard guard(source_mutex_);
      source_ = std::move(fresh);
      if (stopping_) source_->interrupt();
    } catch (const std::exception& error) {
      context_.troubles.mention(error.what());
    }
  }
  ended_ = true;
  queue_.finish();
}

bool VideoLane::capture_from(Source& source) {
  while (std::optional<TimedFrame> frame = source.read()) {
    if (context_.end_ns && frame->time_ns >= *context_.end_ns) return true;
    live_ = true;
    if (away_) state_interruption(frame->time_ns);
    captured_until_ns_ = frame->time_ns;
    queue_.push(std::move(*frame), address_.unpaced());
  }
  return true;
}

void VideoLane::state_interruption(std::int64_t until_ns) {
  queue_.push(Interruption{{std::min(away_since_ns_, until_ns), until_ns}, *away_});
  away_.reset();
}

// --- encoding
// -----------------------------------------------------------------------------------------------------------

void VideoLane::encode() {
  while (std::optional<QueueItem> item = queue_.pop()) {
    if (failed_since_ns_) continue;
    try {
      std::visit(
          [this](auto& value) {
            if constexpr (std::is_same_v<std::decay_t<decltype(value)>, QueuedFrame>) {
              take(std::move(value));
            } else {
              take(value);
            }
          },
          *item);
    } catch (const std::exception& error) {
      fail(error);
    }
  }
}

void VideoLane::take(QueuedFrame item) {
  const std::int64_t time_ns = item.picture.time_ns;
  const PictureFormat format = format_of(*item.picture.frame);
  if (coding_ && !(format == coded_format_)) {
    end_coding(time_ns);
    context_.facts.push(archive::CaseEntryBody(
        archive::GapEntry{name(), {time_ns, time_ns}, archive::GapCause::kFormatChange}));
    context_.troubles.mention("source '" + address_.stated + "' changed to " + std::to_string(format.width) +
                              "x" + std::to_string(format.height) + "; recording goes on in a new segment");
  }
  if (!coding_) {
    Rational rate{25, 1};
    {
      const std::lock_guard guard(source_mutex_);
      if (source_) rate = source_->frame_rate();
    }
    frame_ns_ = 1'000'000'000LL * rate.denominator / rate.numerator;
    coding_ = std::make_unique<Coding>(format, rate, profile_);
    coded_format_ = format;
  }
  if (item.dropped_before > 0) {
    segment_dropped_ += item.dropped_before;
    context_.facts.push(
        archive::CaseEntryBody(archive::GapEntry{name(), *item.overload, archive::GapCause::kOverload}));
  }
  if (media::Frame prepared = coding_->encoder.prepare(std::move(item.picture.frame), time_ns))
    record(std::move(prepared));
}

void VideoLane::record(media::Frame prepared) {
  const std::int64_t time_ns = prepared->pts;
  if (output_.is_open() && (time_ns >= boundary_ns_ || output_.open_bytes() >= kLargestSegmentBytes))
    end_segment(time_ns);
  const bool first = !output_.is_open();
  media::Packet packet = coding_->encoder.encode(std::move(prepared), first);
  if (first) {
    const SegmentTime stated = coding_->muxer->stated(packet->pts);
    output_.begin(time_ns, stated.pts, stated.time_base);
    boundary_ns_ = next_boundary(time_ns, context_.segment_duration);
    coding_->muxer->begin([this](ByteView bytes) { output_.write(bytes); });
  }
  last_frame_ns_ = time_ns;
  coding_->muxer->write(std::move(packet), 0);
  ++segment_frames_;
  ++frames_;
  last_ns_ = time_ns + frame_ns_;
}

void VideoLane::take(const Interruption& interruption) {
  if (coding_) end_coding(std::max(interruption.span.start_ns, last_frame_ns_ + 1));
  archive::GapEntry gap{name(), interruption.span, interruption.cause};
  if (frames_ > 0) gap.span.start_ns = std::max(gap.span.start_ns, last_frame_ns_ + 1);
  gap.span.end_ns = std::max(gap.span.start_ns, gap.span.end_ns);
  context_.facts.push(archive::CaseEntryBody(gap));
}

void VideoLane::end_segment(std::int64_t end_ns) {
  if (!output_.is_open()) return;
  coding_->muxer->end();
  output_.end({end_ns, segment_frames_, segment_dropped_});
  segment_frames_ = segment_dropped_ = 0;
}

void VideoLane::end_coding(std::int64_t end_ns) {
  if (!coding_) return;
  while (media::Frame held = coding_->encoder.drain()) record(std::move(held));
  end_segment(end_ns);
  coding_.reset();
}

void VideoLane::fail(const std::exception& error) {
  failed_since_ns_ = last_frame_ns_;
  context_.troubles.end_session(close_reason_for(error), error.what());
  try {
    output_.give_up({last_frame_ns_ + 1, segment_frames_, segment_dropped_});
  } catch (const std::exception& second) {
    context_.troubles.mention(second.what());
  }
  coding_.reset();
  queue_.abandon();
  stop();
}

void VideoLane::finish(std::int64_t close_ns) {
  stop();
  if (capture_thread_.joinable()) capture_thread_.join();
  if (encode_thread_.joinable()) encode_thread_.join();
  if (!failed_since_ns_) {
    try {
      if (const std::optional<QueuedFrame> drops = queue_.unstated_drops()) {
        segment_dropped_ += drops->dropped_before;
        context_.facts.push(archive::CaseEntryBody(
            archive::GapEntry{name(), *drops->overload, archive::GapCause::kOverload}));
      }
      end_coding(std::min(last_frame_ns_ + frame_ns_,
                          std::max(context_.end_ns.value_or(INT64_MAX), last_frame_ns_ + 1)));
      output_.drain();
    } catch (const std::exception& error) {
      fail(error);
    }
  }
  if (failed_since_ns_) {
    const std::int64_t since = std::min(*failed_since_ns_ + 1, close_ns);
    context_.facts.push(
        archive::CaseEntryBody(archive::GapEntry{name(), {since, close_ns}, archive::GapCause::kDiskFull}));
  } else if (away_) {
    const std::int64_t since = frames_ > 0 ? last_frame_ns_ + frame_ns_ : 0;
    context_.facts.push(
        archive::CaseEntryBody(archive::GapEntry{name(), {std::min(since, close_ns), close_ns}, *away_}));
  }
}

}  // namespace kiroku::recorder
