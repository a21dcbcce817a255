#include "recorder/encoder/video_encoder.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/opt.h>
#include <libavutil/pixdesc.h>
}

#include <algorithm>
#include <array>
#include <thread>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

using media::require;

// ISO 13818-2 codes sizes in 12 bits and two bits of extension; FFmpeg's encoder stays within 12.
constexpr int kMpeg2LargestSide = 4095;
constexpr std::array<AVRational, 8> kMpeg2Rates{
    {{24000, 1001}, {24, 1}, {25, 1}, {30000, 1001}, {30, 1}, {50, 1}, {60000, 1001}, {60, 1}}};
// DVD's buffer: what every MPEG-2 decoder at main level has.
constexpr int kMpeg2BufferBits = 1'835'008;
constexpr int kMpeg2GroupOfPictures = 15;

AVPixelFormat pixel_format(const PictureFormat& format) {
  return static_cast<AVPixelFormat>(format.pixel_format);
}

std::string pixel_format_name(AVPixelFormat format) {
  const char* name = av_get_pix_fmt_name(format);
  return name == nullptr ? "unknown" : name;
}

AVPixelFormat ffv1_format(AVPixelFormat source, const AVCodec& codec) {
  const AVPixelFormat* known = codec.pix_fmts;
  if (std::find(known, known + 64, AV_PIX_FMT_NONE) == known + 64) return AV_PIX_FMT_NONE;
  int loss = 0;
  const AVPixelFormat best = avcodec_find_best_pix_fmt_of_list(known, source, 0, &loss);
  if (loss != 0) {
    throw UsageError("lossless recording cannot hold pixel format " + pixel_format_name(source) +
                     " without loss; choose another format at the source, or --profile uncompressed");
  }
  return best;
}

}  // namespace

VideoEncoder::VideoEncoder(const PictureFormat& format, Rational frame_rate, const VideoProfile& profile) {
  const AVCodecID id = profile.profile == Profile::kMpeg2          ? AV_CODEC_ID_MPEG2VIDEO
                       : profile.profile == Profile::kUncompressed ? AV_CODEC_ID_RAWVIDEO
                                                                   : AV_CODEC_ID_FFV1;
  const std::string size = std::to_string(format.width) + "x" + std::to_string(format.height);
  const AVCodec* codec = avcodec_find_encoder(id);
  if (codec == nullptr)
    throw Error("this libavcodec has no encoder " + std::string(avcodec_get_name(id)) +
                "; install Debian's FFmpeg libraries");
  const AVPixelFormat source = pixel_format(format);
  AVPixelFormat wanted = source;
  AVRational rate{frame_rate.numerator, frame_rate.denominator};

  const auto open = [&](AVRational coded_rate) {
    codec_.reset(avcodec_alloc_context3(codec));
    if (!codec_) throw std::bad_alloc();
    codec_->width = format.width;
    codec_->height = format.height;
    codec_->pix_fmt = wanted;
    codec_->framerate = coded_rate;
    codec_->sample_aspect_ratio = {format.sample_aspect.numerator, format.sample_aspect.denominator};
    codec_->color_range = static_cast<AVColorRange>(format.colour_range);
    codec_->color_primaries = static_cast<AVColorPrimaries>(format.colour_primaries);
    codec_->color_trc = static_cast<AVColorTransferCharacteristic>(format.colour_transfer);
    codec_->colorspace = static_cast<AVColorSpace>(format.colour_space);
    codec_->thread_count = std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 4);
    codec_->thread_type = FF_THREAD_SLICE;
    codec_->time_base = profile.in_transport_stream() ? av_inv_q(coded_rate) : AVRational{1, 1000};
    media::Options options;
    if (id == AV_CODEC_ID_MPEG2VIDEO) {
      // Rate control counts pictures: where the coded rate is not the real one, it must allow each picture
      // its real share.
      const double share = av_q2d(coded_rate) / av_q2d(rate);
      codec_->bit_rate = static_cast<std::int64_t>(static_cast<double>(profile.bit_rate) * share);
      codec_->rc_max_rate = codec_->bit_rate * 3 / 2;
      codec_->rc_buffer_size =
          static_cast<int>(std::max<std::int64_t>(kMpeg2BufferBits, codec_->bit_rate / 2));
      codec_->gop_size = kMpeg2GroupOfPictures;
      // Without B pictures nothing is reordered, so nothing need be held back.
      codec_->max_b_frames = 0;
      codec_->flags |= static_cast<int>(AV_CODEC_FLAG_CLOSED_GOP | AV_CODEC_FLAG_LOW_DELAY);
      options.set("sc_threshold",
                  "1000000000");  // key frames come where segments begin, not at cuts of the scene
      if (profile.chroma_422) codec_->profile = FF_PROFILE_MPEG2_422;
    } else if (id == AV_CODEC_ID_FFV1) {
      codec_->gop_size = 1;
      codec_->level = 3;
      options.set("slicecrc", "1");
      options.set("slices", format.width * format.height >= 640 * 360 ? "4" : "1");
    }
    return avcodec_open2(codec_.get(), codec, options.address());
  };

  if (id == AV_CODEC_ID_MPEG2VIDEO) {
    if (format.width > kMpeg2LargestSide || format.height > kMpeg2LargestSide) {
      throw UsageError("a picture of " + size +
                       " is larger than MPEG-2 can hold (4095x4095); use --profile lossless");
    }
    if (profile.bit_rate < 100'000 || profile.bit_rate > 300'000'000)
      throw UsageError("MPEG-2's bit rate must be from 100 kbit/s to 300 Mbit/s");
    wanted = profile.chroma_422 ? AV_PIX_FMT_YUV422P : AV_PIX_FMT_YUV420P;
    // MPEG-2 has a handful of frame rates; others are coded at the next higher one, each picture keeping its
    // own time stamp.
    const auto exact = std::find_if(kMpeg2Rates.begin(), kMpeg2Rates.end(),
                                    [&](AVRational r) { return av_cmp_q(r, rate) == 0; });
    if (exact != kMpeg2Rates.end() || open(rate) < 0) {
      const auto next = std::find_if(kMpeg2Rates.begin(), kMpeg2Rates.end(),
                                     [&](AVRational r) { return av_cmp_q(r, rate) >= 0; });
      require(open(next == kMpeg2Rates.end() ? kMpeg2Rates.back() : *next),
              "cannot encode a picture of " + size + " as MPEG-2");
    }
  } else {
    if (id == AV_CODEC_ID_RAWVIDEO && avcodec_pix_fmt_to_codec_tag(source) == 0) {
      throw UsageError("Matroska has no name for uncompressed " + pixel_format_name(source) +
                       "; choose another format at the source, or --profile lossless");
    }
    if (id == AV_CODEC_ID_FFV1) wanted = ffv1_format(source, *codec);
    require(open(rate), "cannot encode a picture of " + size + " with " + avcodec_get_name(id));
    if (id == AV_CODEC_ID_RAWVIDEO) codec_->codec_tag = avcodec_pix_fmt_to_codec_tag(source);
  }

  std::string conversion = profile.deinterlace ? "bwdif=mode=send_frame:deint=interlaced" : "";
  if (wanted != source)
    conversion += (conversion.empty() ? "" : ",") + ("format=" + pixel_format_name(wanted));
  if (!conversion.empty()) filter_ = std::make_unique<FrameFilter>(format, conversion);
}

std::int64_t VideoEncoder::pts_of(std::int64_t time_ns) {
  const std::int64_t pts = av_rescale_q(time_ns, AVRational{1, 1'000'000'000}, codec_->time_base);
  last_pts_ = std::max(pts, last_pts_ + 1);
  return last_pts_;
}

media::Frame VideoEncoder::prepare(media::Frame frame, std::int64_t time_ns) {
  frame->pts = time_ns;
  return filter_ ? filter_->apply(std::move(frame)) : std::move(frame);
}

media::Frame VideoEncoder::drain() { return filter_ ? filter_->drain() : media::Frame(); }

media::Packet VideoEncoder::encode(media::Frame prepared, bool first_of_segment) {
  prepared->pts = pts_of(prepared->pts);
  // A source's own picture types would be taken for orders.
  prepared->pict_type = first_of_segment ? AV_PICTURE_TYPE_I : AV_PICTURE_TYPE_NONE;
  require(avcodec_send_frame(codec_.get(), prepared.get()), "cannot encode a picture");
  media::Packet packet = media::make_packet();
  require(avcodec_receive_packet(codec_.get(), packet.get()), "cannot encode a picture");
  if (packet->duration == 0)
    packet->duration =
        std::max<std::int64_t>(1, av_rescale_q(1, av_inv_q(codec_->framerate), codec_->time_base));
  return packet;
}

}  // namespace kiroku::recorder
