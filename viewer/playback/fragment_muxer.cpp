#include "viewer/playback/fragment_muxer.h"

#include <array>
#include <cstdio>
#include <span>
#include <utility>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/mem.h>
#include <libavutil/opt.h>
}

#include "base/error.h"
#include "viewer/playback/case_ticks.h"

namespace kiroku::playback {
namespace {

using media::require;

constexpr const char* kAction = "cannot make a viewing copy";
constexpr AVRational kTimeBase{1, kTicksPerSecond};

AVRational time_base_of(const AVCodecContext& encoder) {
  return encoder.codec_type == AVMEDIA_TYPE_AUDIO ? AVRational{1, encoder.sample_rate} : kTimeBase;
}

/// Profile, constraints and level stand in the sequence parameter set (ISO 14496-10, 7.3.2.1.1), the first
/// of the encoder's parameters behind their start codes.
std::string codecs_of(const AVCodecContext& encoder) {
  if (encoder.codec_id == AV_CODEC_ID_FLAC) return "flac";
  const std::span bytes(encoder.extradata, static_cast<std::size_t>(encoder.extradata_size));
  constexpr std::uint8_t kSequenceParameterSet = 7;
  constexpr std::uint8_t kTypeMask = 0x1f;
  for (std::size_t at = 0; at + 7 <= bytes.size(); ++at) {
    if (bytes[at] == 0 && bytes[at + 1] == 0 && bytes[at + 2] == 1 &&
        (bytes[at + 3] & kTypeMask) == kSequenceParameterSet) {
      std::array<char, 16> text{};
      std::snprintf(text.data(), text.size(), "avc1.%02x%02x%02x", unsigned{bytes[at + 4]},
                    unsigned{bytes[at + 5]}, unsigned{bytes[at + 6]});
      return text.data();
    }
  }
  throw Error("cannot make a viewing copy: x264 gave no parameters");
}

media::OutputContext make_context(const AVCodecContext& encoder) {
  AVFormatContext* raw = nullptr;
  require(avformat_alloc_output_context2(&raw, nullptr, "mp4", nullptr), kAction);
  media::OutputContext context(raw);
  context->flags |= AVFMT_FLAG_CUSTOM_IO | AVFMT_FLAG_BITEXACT;
  context->avoid_negative_ts = AVFMT_AVOID_NEG_TS_DISABLED;
  // This libavformat has yet to call FLAC in MP4 more than that; what it writes has not changed since.
  if (encoder.codec_id == AV_CODEC_ID_FLAC) context->strict_std_compliance = FF_COMPLIANCE_EXPERIMENTAL;
  AVStream* const stream = avformat_new_stream(context.get(), nullptr);
  if (stream == nullptr) throw std::bad_alloc();
  require(avcodec_parameters_from_context(stream->codecpar, &encoder), kAction);
  stream->time_base = time_base_of(encoder);
  stream->sample_aspect_ratio = encoder.sample_aspect_ratio;
  return context;
}

}  // namespace

media::Codec make_viewing_encoder(const ViewingFormat& format, const char* preset) {
  media::silence_libav();
  const AVCodec* const codec = avcodec_find_encoder_by_name("libx264");
  if (codec == nullptr) {
    throw Error("this libavcodec has no x264 for viewing copies; install Debian's FFmpeg libraries");
  }
  media::Codec encoder(avcodec_alloc_context3(codec));
  if (!encoder) throw std::bad_alloc();
  encoder->width = format.width;
  encoder->height = format.height;
  encoder->sample_aspect_ratio = {format.aspect_numerator, format.aspect_denominator};
  encoder->pix_fmt = AV_PIX_FMT_YUV420P;
  encoder->color_range = AVCOL_RANGE_MPEG;
  encoder->color_primaries = static_cast<AVColorPrimaries>(format.primaries);
  encoder->color_trc = static_cast<AVColorTransferCharacteristic>(format.transfer);
  encoder->colorspace = static_cast<AVColorSpace>(format.matrix);
  encoder->time_base = kTimeBase;
  encoder->framerate = {format.rate, 1};
  encoder->profile = FF_PROFILE_H264_HIGH;
  encoder->flags |= static_cast<int>(AV_CODEC_FLAG_GLOBAL_HEADER | AV_CODEC_FLAG_CLOSED_GOP);
  encoder->thread_count = 1;
  media::Options options;
  options.set("preset", preset);
  options.set("tune", "zerolatency");  // no picture waits for a later one, none is reordered
  options.set("crf", "21");
  options.set("forced-idr", "1");
  options.set("x264-params", "keyint=infinite:scenecut=0");
  require(avcodec_open2(encoder.get(), codec, options.address()), kAction);
  return encoder;
}

/// What libavformat writes, in memory.
class FragmentMuxer::Output {
 public:
  explicit Output(AVFormatContext& context) : context_(context) { begin(); }
  ~Output() { (void)take(); }
  Output(const Output&) = delete;
  Output& operator=(const Output&) = delete;

  void begin() { require(avio_open_dyn_buf(&context_.pb), kAction); }
  Bytes take() {
    if (context_.pb == nullptr) return {};
    std::uint8_t* raw = nullptr;
    const int size = avio_close_dyn_buf(std::exchange(context_.pb, nullptr), &raw);
    const auto view = std::as_bytes(std::span(raw, static_cast<std::size_t>(size)));
    Bytes bytes(view.begin(), view.end());
    av_free(raw);
    return bytes;
  }

 private:
  AVFormatContext& context_;
};

FragmentMuxer::FragmentMuxer(const AVCodecContext& encoder, std::uint32_t sequence_number)
    : context_(make_context(encoder)), output_(std::make_unique<Output>(*context_)) {
  media::Options options;
  // frag_discont: decode times are the packets' own, not counted from zero
  options.set("movflags", "empty_moov+default_base_moof+frag_custom+frag_discont+skip_trailer");
  options.set("use_editlist", "0");
  options.set("video_track_timescale", std::to_string(kTicksPerSecond));
  options.set("fragment_index", std::to_string(sequence_number));
  require(avformat_write_header(context_.get(), options.address()), kAction);
  init_ = {output_->take(), codecs_of(encoder)};
  output_->begin();
}

FragmentMuxer::~FragmentMuxer() { av_write_trailer(context_.get()); }

void FragmentMuxer::write(AVPacket& packet) {
  packet.stream_index = 0;
  require(av_write_frame(context_.get(), &packet), kAction);
}

Bytes FragmentMuxer::fragment() {
  require(av_write_frame(context_.get(), nullptr), kAction);
  Bytes bytes = output_->take();
  output_->begin();
  // It holds for one fragment: the next would begin where this one's last duration says, not where its
  // picture does, and pictures that were passed over would be missing from its time.
  require(av_opt_set(context_->priv_data, "movflags", "+frag_discont", 0), kAction);
  return bytes;
}

}  // namespace kiroku::playback
