#include "viewer/playback/picture_reader.h"

#include <algorithm>
#include <deque>
#include <utility>

extern "C" {
#include <libavformat/avformat.h>
#include <libavutil/frame.h>
}

#include "base/error.h"
#include "media/picture_decoder.h"
#include "media/segment_input.h"

namespace kiroku::playback {
namespace {

using media::MediaError;

/// Time stamps of MPEG-TS have 33 bits (ISO 13818-1, 2.4.3.7).
constexpr std::int64_t kTransportWrap = std::int64_t{1} << 33;
/// A segment found by recovery begins at or after where its stream was accounted for, and not days later.
constexpr Ticks kEarliestBeforeEstimate = kTicksPerSecond;
constexpr Ticks kLatestAfterEstimate = 3600 * kTicksPerSecond;

Ticks unwrapped(Ticks difference) {
  const Ticks half = kTransportWrap / 2;
  return (((difference + half) % kTransportWrap) + kTransportWrap) % kTransportWrap - half;
}

/// Packets of one segment's pictures on the case clock.
class SegmentPackets {
 public:
  SegmentPackets(const CaseMedia& media, const VideoIndex& index, const IndexedSegment& segment)
      : wraps_(index.stream.media == "video/mp2t"),
        tolerate_cut_(!segment.entry.complete),
        sealed_(media.open(segment.entry)),
        input_(sealed_, index.stream.media, segment.entry.file.file),
        stream_(&input_.video()),
        start_(segment.start) {
    if (!segment.entry.counted) offset_ = index.offset;
  }
  SegmentPackets(const SegmentPackets&) = delete;
  SegmentPackets& operator=(const SegmentPackets&) = delete;

  [[nodiscard]] const AVStream& stream() const { return *stream_; }

  /// The next packet, its pts in ticks of the case clock; null at the end.
  media::Packet next() {
    media::Packet packet = media::make_packet();
    for (;;) {
      try {
        if (!input_.read(*packet)) return {};
      } catch (const MediaError&) {
        if (tolerate_cut_) return {};
        throw;
      }
      if (packet->stream_index == stream_->index && packet->pts != AV_NOPTS_VALUE) break;
      av_packet_unref(packet.get());
    }
    const Ticks stamp = av_rescale_q(packet->pts, stream_->time_base, {1, kTicksPerSecond});
    if (!first_stamp_) begin_at(stamp);
    const Ticks since = stamp - *first_stamp_;
    packet->pts = start_ + (wraps_ ? unwrapped(since) : since);
    packet->dts = packet->pts;  // the recorder codes no picture after one that follows it
    packet->duration = av_rescale_q(packet->duration, stream_->time_base, {1, kTicksPerSecond});
    return packet;
  }

 private:
  void begin_at(Ticks stamp) {
    first_stamp_ = stamp;
    if (!offset_) return;
    const Ticks late = stamp - *offset_ - start_;
    const Ticks after = wraps_ ? unwrapped(late) : late;
    if (after >= -kEarliestBeforeEstimate && after <= kLatestAfterEstimate) start_ += after;
  }

  bool wraps_, tolerate_cut_;
  media::SealedSegment sealed_;
  media::SegmentInput input_;
  AVStream* stream_;
  Ticks start_;                  // of the first picture
  std::optional<Ticks> offset_;  // where that is an estimate
  std::optional<Ticks> first_stamp_;
};

}  // namespace

struct PictureReader::Open {
  Open(const CaseMedia& media, const VideoIndex& index, const IndexedSegment& segment, int threads)
      : tolerate_cut(!segment.entry.complete),
        packets(media, index, segment),
        decoder(
            packets.stream(), [this](AVPacket& packet) { return take(packet); }, segment.entry.file.file,
            threads) {}

  bool take(AVPacket& packet) {
    media::Packet next;
    if (!waiting.empty()) {
      next = std::move(waiting.front());
      waiting.pop_front();
    } else {
      next = packets.next();
    }
    if (!next) return false;
    if (usual_duration == 0) usual_duration = next->duration;
    av_packet_move_ref(&packet, next.get());
    return true;
  }

  /// False at the end, also of one that was cut off.
  bool next() {
    try {
      return decoder.next();
    } catch (const MediaError&) {
      if (!tolerate_cut) throw;
      return false;
    }
  }

  bool tolerate_cut;
  SegmentPackets packets;
  std::deque<media::Packet> waiting;  // read while looking for where to begin
  Ticks usual_duration = 0;
  media::PictureDecoder decoder;
};

PictureReader::PictureReader(const CaseMedia& media, const VideoIndex& index, Decoding decoding, int threads)
    : media_(media), index_(index), decoding_(decoding), threads_(threads) {}

PictureReader::~PictureReader() = default;

bool PictureReader::open(std::size_t segment) {
  open_.reset();
  for (; segment < index_.segments.size(); ++segment) {
    next_segment_ = segment + 1;
    const IndexedSegment& indexed = index_.segments[segment];
    if (indexed.start >= stop_) {
      next_segment_ = segment;
      return false;
    }
    try {
      open_ = std::make_unique<Open>(media_, index_, indexed, threads_);
      if (decoding_ == Decoding::kKeyFramesOnly) open_->decoder.give_only_key_frames();
      return true;
    } catch (const MediaError&) {
      if (indexed.entry.complete) throw;  // else cut before its first picture
    }
  }
  return false;
}

std::optional<Ticks> PictureReader::seek(Ticks time) {
  last_.reset();
  std::size_t after = index_.segments.size();
  while (after > 0 && index_.segments[after - 1].start > time) --after;
  for (std::size_t segment = after == 0 ? 0 : after - 1;; --segment) {
    if (!open(segment)) return std::nullopt;
    while (media::Packet packet = open_->packets.next()) {
      const Ticks at = packet->pts;
      if ((packet->flags & AV_PKT_FLAG_KEY) != 0 && at <= time) open_->waiting.clear();
      open_->waiting.push_back(std::move(packet));
      if (at > time) break;
    }
    const std::deque<media::Packet>& read = open_->waiting;
    // Where a segment's start was an estimate, its first picture may be later than it.
    const bool begins_later = read.empty() || read.front()->pts > time;
    if (segment > 0 && begins_later) continue;
    return !read.empty() && read.back()->pts > time ? std::optional(read.back()->pts) : std::nullopt;
  }
}

std::optional<ArchivedPicture> PictureReader::next() {
  try {
    while (!open_ || !open_->next()) {
      if (!open(next_segment_)) return std::nullopt;
    }
  } catch (const Error&) {
    open_.reset();
    throw;
  }
  ArchivedPicture picture;
  picture.frame = media::reference(open_->decoder.frame());
  picture.time = last_ ? std::max(picture.frame->pts, *last_ + 1) : picture.frame->pts;
  if (last_ && picture.time - *last_ < kTicksPerSecond) open_->usual_duration = picture.time - *last_;
  picture.usual_duration = open_->usual_duration;
  picture.frame->pts = picture.time;
  last_ = picture.time;
  return picture;
}

}  // namespace kiroku::playback
