#include "recorder/quality/coding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <thread>
#include <utility>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/pixdesc.h>
}

#include "base/error.h"
#include "base/number_text.h"
#include "recorder/encoder/segment_muxer.h"
#include "recorder/encoder/video_encoder.h"

namespace kiroku::recorder {
namespace {

using media::require;

constexpr std::int64_t kSegmentNs = 2'000'000'000;  // as SessionOptions::segment_duration
constexpr int kSegmentSeconds = 2;

struct StatedFamily {
  CodingFamily family;
  std::string_view word, name;
  bool rate, ours;
  const char* encoder;  // of libavcodec, where it is not the recorder's
};
constexpr std::array<StatedFamily, 6> kFamilies{
    {{CodingFamily::kMpeg2, "mpeg2", "MPEG-2 4:2:0", true, true, nullptr},
     {CodingFamily::kMpeg2Chroma422, "mpeg2-422", "MPEG-2 4:2:2", true, true, nullptr},
     {CodingFamily::kLossless, "lossless", "lossless (FFV1)", false, true, nullptr},
     {CodingFamily::kUncompressed, "uncompressed", "uncompressed", false, true, nullptr},
     {CodingFamily::kH264, "h264", "H.264", true, false, "libx264"},
     {CodingFamily::kH265, "h265", "H.265", true, false, "libx265"}}};

const StatedFamily& stated(CodingFamily family) {
  return *std::ranges::find_if(kFamilies, [&](const StatedFamily& one) { return one.family == family; });
}

VideoProfile profile_of(const Coding& coding) {
  VideoProfile profile;
  profile.chroma_422 = coding.family == CodingFamily::kMpeg2Chroma422;
  if (coding.family == CodingFamily::kLossless) profile.profile = Profile::kLossless;
  if (coding.family == CodingFamily::kUncompressed) profile.profile = Profile::kUncompressed;
  if (coding.bit_rate > 0) profile.bit_rate = coding.bit_rate;
  return profile;
}

int threads() { return std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 4); }

media::Codec open_foreign_encoder(const Coding& coding, const PictureFormat& format, Rational rate) {
  const char* const name = stated(coding.family).encoder;
  const AVCodec* const codec = avcodec_find_encoder_by_name(name);
  if (codec == nullptr) throw Error(std::string("this libavcodec has no ") + name);
  media::Codec encoder(avcodec_alloc_context3(codec));
  if (!encoder) throw std::bad_alloc();
  encoder->width = format.width;
  encoder->height = format.height;
  encoder->pix_fmt = static_cast<AVPixelFormat>(format.pixel_format);
  encoder->framerate = {rate.numerator, rate.denominator};
  encoder->time_base = {1, 1000};  // Matroska's
  encoder->color_range = static_cast<AVColorRange>(format.colour_range);
  encoder->colorspace = static_cast<AVColorSpace>(format.colour_space);
  encoder->bit_rate = coding.bit_rate;
  encoder->rc_max_rate = coding.bit_rate * 3 / 2;
  encoder->rc_buffer_size = static_cast<int>(coding.bit_rate * 3 / 2);
  encoder->gop_size =
      std::max(1, static_cast<int>(std::lround(kSegmentSeconds * double(rate.numerator) / rate.denominator)));
  encoder->thread_count = threads();
  encoder->flags |= static_cast<int>(AV_CODEC_FLAG_GLOBAL_HEADER);
  media::Options options;
  options.set("preset", "medium");
  if (coding.family == CodingFamily::kH265) options.set("x265-params", "log-level=none");
  require(avcodec_open2(encoder.get(), codec, options.address()),
          coding.name() + " cannot hold pictures of " + format.to_string());
  return encoder;
}

/// An encoder and its container.
class Writer {
 public:
  using Taker = std::function<void(const AVPacket&)>;
  Writer() = default;
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;
  virtual ~Writer() = default;
  virtual void put(media::Frame picture, const Taker& take) = 0;
  virtual void finish(const Taker& take) = 0;
  [[nodiscard]] virtual const AVCodecContext& encoder() const = 0;
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

 protected:
  SegmentSink counting() {
    return [this](ByteView bytes) { bytes_ += bytes.size(); };
  }

 private:
  std::uint64_t bytes_ = 0;
};

/// As a lane of the recorder does it.
class RecordersWriter : public Writer {
 public:
  RecordersWriter(const Coding& coding, const PictureFormat& format, Rational rate)
      : encoder_(format, rate, profile_of(coding)),
        muxer_(profile_of(coding).in_transport_stream() ? make_transport_stream_muxer()
                                                        : make_matroska_muxer()) {}

  void put(media::Frame picture, const Taker& take) override {
    const std::int64_t time_ns = picture->pts;
    media::Frame prepared = encoder_.prepare(std::move(picture), time_ns);
    if (!prepared) throw Error("the encoder kept a picture back");
    const bool first = !segment_began_ns_ || time_ns - *segment_began_ns_ >= kSegmentNs;
    if (first) {
      if (segment_began_ns_) muxer_->end();
      muxer_->begin({encoder_.muxed_stream()}, counting());
      segment_began_ns_ = time_ns;
    }
    media::Packet packet = encoder_.encode(std::move(prepared), first);
    take(*packet);
    muxer_->write(std::move(packet), 0);
  }
  void finish(const Taker& /*take*/) override {
    if (segment_began_ns_) muxer_->end();
  }
  [[nodiscard]] const AVCodecContext& encoder() const override { return *encoder_.muxed_stream().encoder; }

 private:
  VideoEncoder encoder_;
  std::unique_ptr<SegmentMuxer> muxer_;
  std::optional<std::int64_t> segment_began_ns_;
};

class ForeignWriter : public Writer {
 public:
  ForeignWriter(const Coding& coding, const PictureFormat& format, Rational rate)
      : encoder_(open_foreign_encoder(coding, format, rate)), muxer_(make_matroska_muxer()) {
    muxer_->begin({{encoder_.get(), {encoder_->time_base.num, encoder_->time_base.den}}}, counting());
  }
  void put(media::Frame picture, const Taker& take) override {
    const std::int64_t pts = av_rescale_q(picture->pts, {1, 1'000'000'000}, encoder_->time_base);
    picture->pts = last_pts_ = std::max(pts, last_pts_ + 1);
    picture->pict_type = AV_PICTURE_TYPE_NONE;
    encode(picture.get(), take);
  }
  void finish(const Taker& take) override {
    encode(nullptr, take);
    muxer_->end();
  }
  [[nodiscard]] const AVCodecContext& encoder() const override { return *encoder_; }

 private:
  void encode(const AVFrame* picture, const Taker& take) {
    constexpr const char* kAction = "cannot encode a picture";
    require(avcodec_send_frame(encoder_.get(), picture), kAction);
    for (;;) {
      media::Packet packet = media::make_packet();
      const int received = avcodec_receive_packet(encoder_.get(), packet.get());
      if (received == AVERROR(EAGAIN) || received == AVERROR_EOF) return;
      require(received, kAction);
      take(*packet);
      muxer_->write(std::move(packet), 0);
    }
  }

  media::Codec encoder_;
  std::unique_ptr<SegmentMuxer> muxer_;
  std::int64_t last_pts_ = -1;
};

std::unique_ptr<Writer> make_writer(const Coding& coding, const PictureFormat& format, Rational rate) {
  if (coding.is_ours()) return std::make_unique<RecordersWriter>(coding, format, rate);
  return std::make_unique<ForeignWriter>(coding, format, rate);
}

}  // namespace

std::string_view coding_word(CodingFamily family) { return stated(family).word; }
bool has_rate(CodingFamily family) { return stated(family).rate; }

CodingFamily parse_coding(std::string_view word) {
  std::string known;
  for (const StatedFamily& family : kFamilies) {
    if (family.word == word) return family.family;
    known += (known.empty() ? "" : ", ") + std::string(family.word);
  }
  throw UsageError("there is no coding '" + std::string(word) + "'; known are " + known);
}

std::string Coding::name() const {
  std::string text(stated(family).name);
  if (bit_rate > 0) text += ", " + number_text(static_cast<double>(bit_rate) * 1e-6, 4) + " Mbit/s";
  return text;
}
bool Coding::is_ours() const { return stated(family).ours; }

std::vector<Coding> usual_codings() {
  constexpr std::int64_t kMega = 1'000'000;
  std::vector<Coding> codings;
  const auto add = [&](CodingFamily family, std::initializer_list<std::int64_t> rates) {
    for (const std::int64_t rate : rates) codings.push_back({family, rate * kMega});
  };
  add(CodingFamily::kMpeg2, {1, 2, 4, 8, 15});
  add(CodingFamily::kMpeg2Chroma422, {4, 8, 15, 25});
  add(CodingFamily::kLossless, {0});
  add(CodingFamily::kUncompressed, {0});
  add(CodingFamily::kH264, {1, 2, 4, 8, 15});
  add(CodingFamily::kH265, {1, 2, 4, 8});
  return codings;
}

class RoundTrip::Impl {
 public:
  Impl(const Coding& coding, const PictureFormat& format, Rational rate)
      : name_(coding.name()), writer_(make_writer(coding, format, rate)) {
    const AVCodecContext& encoder = writer_->encoder();
    const AVCodec* const codec = avcodec_find_decoder(encoder.codec_id);
    if (codec == nullptr) throw Error("this libavcodec cannot decode " + name_);
    decoder_.reset(avcodec_alloc_context3(codec));
    const media::CodecParameters parameters(avcodec_parameters_alloc());
    if (!decoder_ || !parameters) throw std::bad_alloc();
    require(avcodec_parameters_from_context(parameters.get(), &encoder), "cannot decode " + name_);
    require(avcodec_parameters_to_context(decoder_.get(), parameters.get()), "cannot decode " + name_);
    decoder_->thread_count = threads();
    require(avcodec_open2(decoder_.get(), codec, nullptr), "cannot decode " + name_);
  }

  void put(const AVFrame& picture, const Taker& take) {
    writer_->put(media::reference(picture), [&](const AVPacket& packet) { decode(&packet, take); });
  }
  void finish(const Taker& take) {
    writer_->finish([&](const AVPacket& packet) { decode(&packet, take); });
    decode(nullptr, take);
  }
  [[nodiscard]] std::uint64_t bytes() const { return writer_->bytes(); }

 private:
  void decode(const AVPacket* packet, const Taker& take) {
    const std::string action = "cannot decode " + name_;
    require(avcodec_send_packet(decoder_.get(), packet), action);
    for (;;) {
      media::Frame frame = media::make_frame();
      const int received = avcodec_receive_frame(decoder_.get(), frame.get());
      if (received == AVERROR(EAGAIN) || received == AVERROR_EOF) return;
      require(received, action);
      // Else libswscale would take full range for limited (clip.h, as_format()).
      state_range_apart(*frame);
      take(std::move(frame));
    }
  }

  const std::string name_;
  std::unique_ptr<Writer> writer_;
  media::Codec decoder_;
};

RoundTrip::RoundTrip(const Coding& coding, const PictureFormat& format, Rational frame_rate)
    : impl_(std::make_unique<Impl>(coding, format, frame_rate)) {}
RoundTrip::~RoundTrip() = default;
void RoundTrip::put(const AVFrame& picture, const Taker& take) { impl_->put(picture, take); }
void RoundTrip::finish(const Taker& take) { impl_->finish(take); }
std::uint64_t RoundTrip::bytes() const { return impl_->bytes(); }

}  // namespace kiroku::recorder
