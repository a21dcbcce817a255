#include "viewer/playback/segment_packets.h"

#include <utility>

extern "C" {
#include <libavcodec/packet.h>
#include <libavformat/avformat.h>
}

#include "archive/format/segment_media.h"
#include "media/stream_clock.h"

namespace kiroku::playback {
namespace {

/// A segment found by recovery begins at or after where its stream was accounted for, and not days later.
constexpr Ticks kEarliestBeforeEstimate = ticks_of_ns(media::kEarliestBeforeEstimateNs);
constexpr Ticks kLatestAfterEstimate = ticks_of_ns(media::kLatestAfterEstimateNs);

Ticks ticks_of(std::int64_t stamp, const AVStream& stream) {
  return av_rescale_q(stamp, stream.time_base, {1, kTicksPerSecond});
}

}  // namespace

SegmentPackets::SegmentPackets(const SegmentOpener& media, const VideoIndex& index,
                               const IndexedSegment& segment, Of which)
    : wraps_(archive::media_of(index.stream, segment.entry) == "video/mp2t"),
      tolerate_cut_(!segment.entry.complete),
      plaintext_(media.open_plaintext(segment.entry)),
      input_(*plaintext_, archive::media_of(index.stream, segment.entry), segment.entry.file.file),
      pictures_(&input_.video()),
      stream_(which == Of::kPictures ? pictures_ : input_.sound()),
      start_(segment.start) {
  if (!segment.entry.counted) offset_ = segment.offset;
}

bool SegmentPackets::read(AVPacket& packet) {
  try {
    return input_.read(packet);
  } catch (const media::MediaError&) {
    if (tolerate_cut_) return false;
    throw;
  }
}

media::Packet SegmentPackets::next_of_both() {
  media::Packet packet = media::make_packet();
  for (; read(*packet); av_packet_unref(packet.get())) {
    const bool is_picture = packet->stream_index == pictures_->index;
    const bool is_wanted = packet->stream_index == stream_->index;
    if (packet->pts == AV_NOPTS_VALUE || (!is_picture && !is_wanted)) continue;
    const AVStream& stream = is_picture ? *pictures_ : *stream_;
    packet->pts = ticks_of(packet->pts, stream);
    packet->duration = ticks_of(packet->duration, stream);
    if (is_picture && !first_stamp_) begin_at(packet->pts);
    return packet;
  }
  return {};
}

media::Packet SegmentPackets::next() {
  if (stream_ == nullptr) return {};
  while (!first_stamp_) {
    media::Packet packet = next_of_both();
    if (!packet) return {};  // without a picture nobody knows when it was
    if (packet->stream_index == stream_->index) early_.push_back(std::move(packet));
  }
  media::Packet packet;
  if (!early_.empty()) {
    packet = std::move(early_.front());
    early_.pop_front();
  } else {
    do packet = next_of_both();
    while (packet && packet->stream_index != stream_->index);
  }
  if (!packet) return {};
  const Ticks since = packet->pts - *first_stamp_;
  packet->pts = start_ + (wraps_ ? media::unwrapped(since) : since);
  packet->dts = packet->pts;  // the recorder codes no picture after one that follows it
  return packet;
}

void SegmentPackets::begin_at(Ticks stamp) {
  first_stamp_ = stamp;
  if (!offset_) return;
  const Ticks late = stamp - *offset_ - start_;
  const Ticks after = wraps_ ? media::unwrapped(late) : late;
  if (after >= -kEarliestBeforeEstimate && after <= kLatestAfterEstimate) start_ += after;
}

}  // namespace kiroku::playback
