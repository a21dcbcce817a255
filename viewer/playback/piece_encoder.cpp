#include "viewer/playback/piece_encoder.h"

#include <utility>

extern "C" {
#include <libavcodec/avcodec.h>
}

#include "media/libav_versions.h"

namespace kiroku::playback {
namespace {

using media::require;

constexpr const char* kAction = "cannot make a viewing copy";
constexpr const char* kPreset = "superfast";

}  // namespace

InitSegment make_init_segment(const ViewingFormat& format) {
  const media::Codec encoder = make_viewing_encoder(format, kPreset);
  return FragmentMuxer(*encoder, 1).init();
}

PieceEncoder::PieceEncoder(const ViewingFormat& format) : codec_(make_viewing_encoder(format, kPreset)) {}

void PieceEncoder::add(const ArchivedPicture& picture) {
  const media::Frame frame = media::reference(*picture.frame);
  frame->pts = picture.time;
  const bool begins_group = packets_.empty() || picture.time / kTicksPerSecond != last_ / kTicksPerSecond;
  // What the archive's decoder says of its pictures is no order to this encoder.
  frame->pict_type = begins_group ? AV_PICTURE_TYPE_I : AV_PICTURE_TYPE_NONE;
  media::set_interlaced(*frame, false);
  last_ = picture.time;
  require(avcodec_send_frame(codec_.get(), frame.get()), kAction);
  receive();
}

void PieceEncoder::receive() {
  for (;;) {
    media::Packet packet = media::make_packet();
    const int result = avcodec_receive_packet(codec_.get(), packet.get());
    if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return;
    require(result, kAction);
    packets_.push_back(std::move(packet));
  }
}

Bytes PieceEncoder::finish(Ticks end, std::uint32_t sequence_number) {
  if (packets_.empty()) return {};
  require(avcodec_send_frame(codec_.get(), nullptr), kAction);
  receive();
  FragmentMuxer muxer(*codec_, sequence_number);
  for (std::size_t i = 0; i < packets_.size(); ++i) {
    AVPacket& packet = *packets_[i];
    packet.duration = (i + 1 < packets_.size() ? packets_[i + 1]->pts : end) - packet.pts;
    muxer.write(packet);
  }
  return muxer.fragment();
}

}  // namespace kiroku::playback
