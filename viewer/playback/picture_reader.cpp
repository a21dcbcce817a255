#include "viewer/playback/picture_reader.h"

#include <algorithm>
#include <deque>
#include <utility>

extern "C" {
#include <libavformat/avformat.h>
#include <libavutil/frame.h>
}

#include "archive/format/segment_media.h"
#include "base/error.h"
#include "media/picture_decoder.h"
#include "viewer/playback/segment_packets.h"

namespace kiroku::playback {
namespace {

using media::MediaError;

}  // namespace

struct PictureReader::Open {
  Open(const SegmentOpener& media, const VideoIndex& index, const IndexedSegment& segment, int threads)
      : tolerate_cut(!segment.entry.complete),
        packets(media, index, segment, SegmentPackets::Of::kPictures),
        decoder(
            *packets.stream(), [this](AVPacket& packet) { return take(packet); }, segment.entry.file.file,
            is_in_matroska(index, segment) ? threads : 1) {}

  /// One is enough for MPEG-2, and several refuse small pictures of it.
  static bool is_in_matroska(const VideoIndex& index, const IndexedSegment& segment) {
    return archive::media_of(index.stream, segment.entry) == "video/x-matroska";
  }

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

PictureReader::PictureReader(const SegmentOpener& media, const VideoIndex& index, Decoding decoding,
                             int threads)
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
