#include "recorder/encoder/video_encoder.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/pixdesc.h>
}

#include <algorithm>
#include <array>
#include <thread>

#include "base/error.h"
#include "media/ffv1_slices.h"
#include "media/libav_versions.h"

namespace kiroku::recorder {
namespace {

using media::require;

// ISO 13818-2 codes sizes in 12 bits and two bits of extension; FFmpeg's encoder stays within 12.
constexpr int kMpeg2LargestSide = 4095;
constexpr std::array<AVRational, 8> kMpeg2Rates{
    {{24000, 1001}, {24, 1}, {25, 1}, {30000, 1001}, {30, 1}, {50, 1}, {60000, 1001}, {60, 1}}};
// The video buffer that every MPEG-2 decoder at main level has.
constexpr int kMpeg2BufferBits = 1'835'008;
constexpr int kMpeg2GroupOfPictures = 15;
// Matroska names uncompressed pictures by a four-character code; these are the formats that FFmpeg writes and
// that come back as what they were.
constexpr std::array<AVPixelFormat, 11> kMatroskaFormats{
    AV_PIX_FMT_YUV420P, AV_PIX_FMT_YUV422P, AV_PIX_FMT_UYVY422, AV_PIX_FMT_YUYV422,
    AV_PIX_FMT_YVYU422, AV_PIX_FMT_NV12,    AV_PIX_FMT_NV21,    AV_PIX_FMT_YUV410P,
    AV_PIX_FMT_YUV411P, AV_PIX_FMT_GRAY8,   AV_PIX_FMT_RGBA};
constexpr AVRational kNanoseconds{1, 1'000'000'000};
/// A burst of pictures is spread over this time at most: a camera that states a rate far below its own would
/// else have its pictures shown minutes after they were taken.
constexpr std::int64_t kLongestSpreadNs = 1'000'000'000;

std::string name_of(AVPixelFormat format) {
  const char* name = av_get_pix_fmt_name(format);
  return name == nullptr ? "unknown" : name;
}

AVPixelFormat pixel_format_of(const PictureFormat& format) {
  return static_cast<AVPixelFormat>(format.pixel_format);
}

std::string size_of(const PictureFormat& format) {
  return std::to_string(format.width) + "x" + std::to_string(format.height);
}

media::Codec new_encoder(AVCodecID id, const PictureFormat& format, AVPixelFormat pixel_format,
                         AVRational rate) {
  const AVCodec* codec = avcodec_find_encoder(id);
  if (codec == nullptr) {
    throw Error("this libavcodec cannot encode " + std::string(avcodec_get_name(id)) +
                "; install Debian's FFmpeg libraries");
  }
  media::Codec encoder(avcodec_alloc_context3(codec));
  if (!encoder) throw std::bad_alloc();
  encoder->width = format.width;
  encoder->height = format.height;
  encoder->pix_fmt = pixel_format;
  encoder->framerate = rate;
  encoder->time_base = av_inv_q(rate);
  encoder->sample_aspect_ratio = {format.sample_aspect.numerator, format.sample_aspect.denominator};
  encoder->color_range = static_cast<AVColorRange>(format.colour_range);
  encoder->color_primaries = static_cast<AVColorPrimaries>(format.colour_primaries);
  encoder->color_trc = static_cast<AVColorTransferCharacteristic>(format.colour_transfer);
  encoder->colorspace = static_cast<AVColorSpace>(format.colour_space);
  encoder->thread_count = std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 4);
  encoder->thread_type = FF_THREAD_SLICE;  // frame threads would hold pictures back
  return encoder;
}

/// MPEG-2 at `coded_rate`; `share` is how much more often than it comes a picture would come at that rate:
/// rate control counts pictures, so each must be allowed the bits of its real share of a second.
media::Codec new_mpeg2_encoder(const PictureFormat& format, AVRational coded_rate, double share,
                               const VideoProfile& profile) {
  const AVPixelFormat pixel_format = profile.chroma_422 ? AV_PIX_FMT_YUV422P : AV_PIX_FMT_YUV420P;
  auto encoder = new_encoder(AV_CODEC_ID_MPEG2VIDEO, format, pixel_format, coded_rate);
  encoder->bit_rate = static_cast<std::int64_t>(static_cast<double>(profile.bit_rate) * share);
  encoder->rc_max_rate = encoder->bit_rate * 3 / 2;
  encoder->rc_buffer_size = static_cast<int>(std::max<std::int64_t>(kMpeg2BufferBits, encoder->bit_rate / 2));
  encoder->gop_size = kMpeg2GroupOfPictures;
  // Without B pictures nothing is reordered, so nothing need be held back.
  encoder->max_b_frames = 0;
  encoder->flags |= static_cast<int>(AV_CODEC_FLAG_CLOSED_GOP | AV_CODEC_FLAG_LOW_DELAY);
  if (profile.chroma_422) encoder->profile = FF_PROFILE_MPEG2_422;
  return encoder;
}

bool try_open(AVCodecContext& encoder, media::Options& options) {
  return avcodec_open2(&encoder, encoder.codec, options.address()) >= 0;
}

bool is_full_range(const PictureFormat& format) { return format.colour_range == AVCOL_RANGE_JPEG; }

}  // namespace

VideoEncoder::VideoEncoder(const PictureFormat& format, Rational frame_rate, const VideoProfile& profile,
                           std::int64_t after_ns)
    : time_base_(profile.in_transport_stream() ? Rational{1, 90'000} : Rational{1, 1'000}),
      interval_ns_(1'000'000'000LL * frame_rate.denominator / frame_rate.numerator),
      last_time_ns_(after_ns),
      last_pts_(after_ns < 0 ? -1 : rescaled(after_ns)) {
  media::silence_libav();
  switch (profile.profile) {
    case Profile::kMpeg2:
      open_mpeg2(format, frame_rate, profile);
      break;
    case Profile::kUncompressed:
      open_uncompressed(format, frame_rate);
      break;
    case Profile::kLossless:
      open_lossless(format, frame_rate);
      break;
  }
  std::string conversion = profile.deinterlace ? "bwdif=mode=send_frame:deint=interlaced" : "";
  const auto add = [&](const std::string& filter) { conversion += (conversion.empty() ? "" : ",") + filter; };
  if (codec_->color_range != format.colour_range) add("scale=in_range=full:out_range=limited");
  if (codec_->pix_fmt != pixel_format_of(format)) add("format=" + name_of(codec_->pix_fmt));
  if (!conversion.empty()) filter_ = std::make_unique<FrameFilter>(format, conversion);
}

void VideoEncoder::open_mpeg2(const PictureFormat& format, Rational frame_rate, const VideoProfile& profile) {
  if (format.width > kMpeg2LargestSide || format.height > kMpeg2LargestSide) {
    throw UsageError("a picture of " + size_of(format) +
                     " is larger than MPEG-2 can hold (4095x4095); use --profile lossless");
  }
  if (profile.bit_rate < 100'000 || profile.bit_rate > 300'000'000) {
    throw UsageError("MPEG-2's bit rate must be from 100 kbit/s to 300 Mbit/s");
  }
  PictureFormat coded = format;
  // MPEG-2 has no word for full range: players would show it too contrasty.
  if (is_full_range(format)) coded.colour_range = AVCOL_RANGE_MPEG;
  const AVRational rate{frame_rate.numerator, frame_rate.denominator};
  const auto open = [&](AVRational coded_rate) {
    media::Options options;
    // Key frames come where segments begin and at the group's end, not at cuts of the scene.
    options.set("sc_threshold", "1000000000");
    codec_ = new_mpeg2_encoder(coded, coded_rate, av_q2d(coded_rate) / av_q2d(rate), profile);
    return try_open(*codec_, options);
  };
  if (open(rate)) return;
  // MPEG-2 has a handful of frame rates; others are coded at the next higher one, each picture keeping its
  // own time stamp.
  const auto* next = std::find_if(kMpeg2Rates.begin(), kMpeg2Rates.end(),
                                  [&](AVRational known) { return av_cmp_q(known, rate) >= 0; });
  if (!open(next == kMpeg2Rates.end() ? kMpeg2Rates.back() : *next)) {
    throw UsageError("a picture of " + size_of(format) +
                     " cannot be encoded as MPEG-2; use --profile lossless");
  }
}

void VideoEncoder::open_uncompressed(const PictureFormat& format, Rational frame_rate) {
  const AVPixelFormat pixel_format = pixel_format_of(format);
  if (std::find(kMatroskaFormats.begin(), kMatroskaFormats.end(), pixel_format) == kMatroskaFormats.end()) {
    throw UsageError("Matroska has no name for uncompressed " + name_of(pixel_format) +
                     "; choose another format at the source, or --profile lossless");
  }
  codec_ =
      new_encoder(AV_CODEC_ID_RAWVIDEO, format, pixel_format, {frame_rate.numerator, frame_rate.denominator});
  media::Options options;
  require(avcodec_open2(codec_.get(), codec_->codec, options.address()),
          "cannot record uncompressed pictures of " + format.to_string());
  codec_->codec_tag = avcodec_pix_fmt_to_codec_tag(pixel_format);
}

void VideoEncoder::open_lossless(const PictureFormat& format, Rational frame_rate) {
  const AVPixelFormat source = pixel_format_of(format);
  const AVCodec* codec = avcodec_find_encoder(AV_CODEC_ID_FFV1);
  const AVPixelFormat* formats = codec == nullptr ? nullptr : media::pixel_formats_of(*codec);
  AVPixelFormat best = source;
  if (formats != nullptr) {
    int loss = 0;
    best = avcodec_find_best_pix_fmt_of_list(formats, source, 0, &loss);
    if (loss != 0) {
      throw UsageError("lossless recording cannot hold pixel format " + name_of(source) +
                       " without loss; choose another format at the source, or --profile uncompressed");
    }
  }
  codec_ = new_encoder(AV_CODEC_ID_FFV1, format, best, {frame_rate.numerator, frame_rate.denominator});
  codec_->gop_size = 1;
  codec_->level = 3;
  media::Options options;
  options.set("slicecrc", "1");
  options.set("slices", media::ffv1_slices(format.width, format.height));
  require(avcodec_open2(codec_.get(), codec_->codec, options.address()),
          "cannot record lossless pictures of " + format.to_string());
}

media::Frame VideoEncoder::prepare(media::Frame frame, std::int64_t time_ns) {
  frame->pts = time_ns;
  return filter_ ? filter_->apply(std::move(frame)) : std::move(frame);
}

media::Frame VideoEncoder::drain() { return filter_ ? filter_->drain() : media::Frame(); }

std::int64_t VideoEncoder::rescaled(std::int64_t time_ns) const {
  return av_rescale_q(time_ns, kNanoseconds, AVRational{time_base_.numerator, time_base_.denominator});
}

std::int64_t VideoEncoder::pts_of(std::int64_t time_ns) {
  const std::int64_t spread_ns = std::min(last_time_ns_ + interval_ns_ / 2, time_ns + kLongestSpreadNs);
  last_time_ns_ = last_time_ns_ < 0 ? time_ns : std::max(time_ns, spread_ns);
  last_pts_ = std::max(rescaled(last_time_ns_), last_pts_ + 1);
  return last_pts_;
}

media::Packet VideoEncoder::encode(media::Frame prepared, bool first_of_segment) {
  // The encoder passes pts on as they are; its own time base only tells it how often pictures come.
  prepared->pts = pts_of(prepared->pts);
  media::set_duration(*prepared, 0);
  // A source's own picture types would be taken for orders.
  prepared->pict_type = first_of_segment ? AV_PICTURE_TYPE_I : AV_PICTURE_TYPE_NONE;
  require(avcodec_send_frame(codec_.get(), prepared.get()), "cannot encode a picture");
  media::Packet packet = media::make_packet();
  require(avcodec_receive_packet(codec_.get(), packet.get()), "cannot encode a picture");
  packet->duration = std::max<std::int64_t>(1, rescaled(interval_ns_));
  return packet;
}

}  // namespace kiroku::recorder
