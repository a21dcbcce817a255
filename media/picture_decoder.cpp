#include "media/picture_decoder.h"

#include <new>
#include <utility>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}

namespace kiroku::media {
namespace {

/// More than any camera gives, and less than would exhaust memory.
constexpr std::int64_t kMostPixels = std::int64_t{16'384} * 16'384;

}  // namespace

PictureDecoder::PictureDecoder(SegmentInput& input, std::string name)
    : PictureDecoder(
          input.video(),
          [&input](AVPacket& packet) {
            while (input.read(packet)) {
              if (packet.stream_index == input.video().index) return true;
              av_packet_unref(&packet);
            }
            return false;
          },
          std::move(name)) {}

PictureDecoder::PictureDecoder(const AVStream& stream, PacketSource packets, std::string name, int threads)
    : packets_(std::move(packets)), name_(std::move(name)) {
  const AVCodec* const decoder = avcodec_find_decoder(stream.codecpar->codec_id);
  if (decoder == nullptr) {
    throw MediaError("the pictures of " + name_ + " are of a kind that this libavcodec cannot decode");
  }
  codec_.reset(avcodec_alloc_context3(decoder));
  if (!codec_) {
    throw std::bad_alloc();
  }
  check(avcodec_parameters_to_context(codec_.get(), stream.codecpar));
  codec_->pkt_timebase = stream.time_base;
  codec_->thread_count = threads;
  codec_->thread_type = FF_THREAD_SLICE;
  codec_->max_pixels = kMostPixels;
  codec_->err_recognition = AV_EF_CRCCHECK | AV_EF_BITSTREAM | AV_EF_BUFFER | AV_EF_EXPLODE;
  codec_->error_concealment = 0;
  check(avcodec_open2(codec_.get(), decoder, nullptr));
}

bool PictureDecoder::next() {
  // Lives for one call, so that other decoders may be used in between.
  const LibavComplaints complaints;
  const auto require_no_complaint = [&] {
    if (!complaints.first().empty()) {
      throw MediaError("picture " + std::to_string(count_ == 0 ? 0 : count_ - 1) + " of " + name_ +
                       " is damaged: " + complaints.first());
    }
  };
  for (;;) {
    const int result = avcodec_receive_frame(codec_.get(), frame_.get());
    if (result == AVERROR_EOF) {
      require_no_complaint();
      return false;
    }
    if (result != AVERROR(EAGAIN)) {
      check(result);
      if (frame_->decode_error_flags != 0 || (frame_->flags & AV_FRAME_FLAG_CORRUPT) != 0) {
        check(AVERROR_INVALIDDATA);
      }
      ++count_;
      require_no_complaint();
      return true;
    }
    require_no_complaint();
    send();
  }
}

void PictureDecoder::send() {
  av_packet_unref(packet_.get());
  check(avcodec_send_packet(codec_.get(), packets_(*packet_) ? packet_.get() : nullptr));
}

void PictureDecoder::give_only_key_frames() { codec_->skip_frame = AVDISCARD_NONKEY; }

void PictureDecoder::check(int result) const {
  if (result < 0) {
    throw MediaError("picture " + std::to_string(count_) + " of " + name_ +
                     " cannot be decoded: " + libav_error_text(result));
  }
}

}  // namespace kiroku::media
