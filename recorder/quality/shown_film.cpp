#include "recorder/quality/shown_film.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <deque>
#include <fcntl.h>
#include <memory>
#include <optional>
#include <thread>
#include <unistd.h>
#include <utility>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/pixdesc.h>
}

#include "base/descriptor.h"
#include "base/error.h"
#include "base/number_text.h"
#include "crypto/secret.h"
#include "media/output_file.h"
#include "media/output_io.h"
#include "recorder/encoder/frame_filter.h"
#include "recorder/quality/clip_trial.h"

namespace kiroku::recorder {
namespace {

using media::require;

constexpr int kTicks = 90'000;  // a second of the film
constexpr std::int64_t kSecondNs = 1'000'000'000;

int threads() { return std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 4); }

/// `format` with 8 bits a sample.
PictureFormat shown_format(PictureFormat format) {
  switch (format.pixel_format) {
    case AV_PIX_FMT_YUV420P10:
      format.pixel_format = AV_PIX_FMT_YUV420P;
      break;
    case AV_PIX_FMT_YUV422P10:
      format.pixel_format = AV_PIX_FMT_YUV422P;
      break;
    case AV_PIX_FMT_YUV444P10:
      format.pixel_format = AV_PIX_FMT_YUV444P;
      break;
    default:
      break;
  }
  return format;
}

/// H.264 holds half the colours, or a quarter of them, in whole pairs of pixels.
void require_even(const PictureFormat& format, const std::filesystem::path& clip) {
  const AVPixFmtDescriptor& described = *av_pix_fmt_desc_get(static_cast<AVPixelFormat>(format.pixel_format));
  const bool odd_width = described.log2_chroma_w > 0 && format.width % 2 != 0;
  const bool odd_height = described.log2_chroma_h > 0 && format.height % 2 != 0;
  if (odd_width || odd_height) {
    throw UsageError(clip.string() + " shows pictures of " + std::to_string(format.width) + "x" +
                     std::to_string(format.height) +
                     ", which browsers cannot be shown without loss: its sides must be even");
  }
}

/// An encoder without loss, its container, and its decoder beside it, which proves that there is none.
class LosslessFilm {
 public:
  LosslessFilm(const std::filesystem::path& file, const PictureFormat& format, Rational rate)
      : name_(file.string()), output_(file, false), io_(output_) {
    open_encoder(format, rate);
    open_container();
    open_decoder();
  }

  void add(media::Frame picture, std::int64_t time_ns) {
    if (!first_ns_) first_ns_ = time_ns;
    const std::int64_t ticks = av_rescale(time_ns - *first_ns_, kTicks, kSecondNs);
    picture->pts = last_ = std::max(ticks, last_ + 1);
    picture->pict_type = AV_PICTURE_TYPE_NONE;
    waiting_.push_back(media::reference(*picture));
    encode(picture.get());
  }

  void finish() {
    encode(nullptr);
    decode(nullptr);
    if (!waiting_.empty()) throw Error(name_ + " lost pictures while it was written");
    io_.check(av_write_trailer(container_.get()), "cannot finish " + name_);
    io_.flush("cannot finish " + name_);
    output_.commit();
  }

 private:
  void open_encoder(const PictureFormat& format, Rational rate) {
    const AVCodec* const codec = avcodec_find_encoder_by_name("libx264");
    if (codec == nullptr)
      throw Error("this libavcodec has no x264, without which no film can be shown; install Debian's");
    encoder_.reset(avcodec_alloc_context3(codec));
    if (!encoder_) throw std::bad_alloc();
    encoder_->width = format.width;
    encoder_->height = format.height;
    encoder_->pix_fmt = static_cast<AVPixelFormat>(format.pixel_format);
    encoder_->sample_aspect_ratio = {format.sample_aspect.numerator,
                                     std::max(1, format.sample_aspect.denominator)};
    encoder_->color_range = static_cast<AVColorRange>(format.colour_range);
    encoder_->color_primaries = static_cast<AVColorPrimaries>(format.colour_primaries);
    encoder_->color_trc = static_cast<AVColorTransferCharacteristic>(format.colour_transfer);
    encoder_->colorspace = static_cast<AVColorSpace>(format.colour_space);
    encoder_->framerate = {rate.numerator, rate.denominator};
    encoder_->time_base = {1, kTicks};
    encoder_->gop_size =
        std::max(1, static_cast<int>(std::lround(double(rate.numerator) / rate.denominator)));
    encoder_->flags |= static_cast<int>(AV_CODEC_FLAG_BITEXACT | AV_CODEC_FLAG_GLOBAL_HEADER);
    encoder_->thread_count = threads();
    media::Options options;
    // What is fast to decode: no picture waits for a later one, and no arithmetic coding.
    options.set("preset", "ultrafast");
    options.set("qp", "0");
    require(avcodec_open2(encoder_.get(), codec, options.address()), "cannot write " + name_);
  }

  void open_container() {
    AVFormatContext* raw = nullptr;
    require(avformat_alloc_output_context2(&raw, nullptr, "mp4", nullptr), "cannot begin " + name_);
    container_.reset(raw);
    container_->pb = io_.context();
    container_->flags |= AVFMT_FLAG_CUSTOM_IO | AVFMT_FLAG_BITEXACT;
    AVStream* const stream = avformat_new_stream(container_.get(), nullptr);
    if (stream == nullptr) throw std::bad_alloc();
    require(avcodec_parameters_from_context(stream->codecpar, encoder_.get()), "cannot begin " + name_);
    stream->time_base = encoder_->time_base;
    stream->avg_frame_rate = encoder_->framerate;
    stream->sample_aspect_ratio = encoder_->sample_aspect_ratio;
    io_.check(avformat_write_header(container_.get(), nullptr), "cannot begin " + name_);
  }

  void open_decoder() {
    const AVCodec* const codec = avcodec_find_decoder(AV_CODEC_ID_H264);
    if (codec == nullptr) throw Error("this libavcodec cannot decode H.264");
    decoder_.reset(avcodec_alloc_context3(codec));
    const media::CodecParameters parameters(avcodec_parameters_alloc());
    if (!decoder_ || !parameters) throw std::bad_alloc();
    require(avcodec_parameters_from_context(parameters.get(), encoder_.get()), "cannot decode " + name_);
    require(avcodec_parameters_to_context(decoder_.get(), parameters.get()), "cannot decode " + name_);
    decoder_->thread_count = threads();
    require(avcodec_open2(decoder_.get(), codec, nullptr), "cannot decode " + name_);
  }

  void encode(const AVFrame* picture) {
    const std::string action = "cannot encode a picture of " + name_;
    require(avcodec_send_frame(encoder_.get(), picture), action);
    const media::Packet packet = media::make_packet();
    for (;;) {
      const int received = avcodec_receive_packet(encoder_.get(), packet.get());
      if (received == AVERROR(EAGAIN) || received == AVERROR_EOF) return;
      require(received, action);
      decode(packet.get());
      const AVStream& stream = *container_->streams[0];
      packet->stream_index = 0;
      if (packet->duration == 0)
        packet->duration = av_rescale_q(1, av_inv_q(encoder_->framerate), encoder_->time_base);
      av_packet_rescale_ts(packet.get(), encoder_->time_base, stream.time_base);
      io_.check(av_interleaved_write_frame(container_.get(), packet.get()), "cannot write " + name_);
    }
  }

  void decode(const AVPacket* packet) {
    const std::string action = "cannot decode " + name_;
    require(avcodec_send_packet(decoder_.get(), packet), action);
    for (;;) {
      const media::Frame picture = media::make_frame();
      const int received = avcodec_receive_frame(decoder_.get(), picture.get());
      if (received == AVERROR(EAGAIN) || received == AVERROR_EOF) return;
      require(received, action);
      if (waiting_.empty() || !same_samples(*waiting_.front(), *picture))
        throw Error(name_ + " does not give its pictures back as they are, so it is no film to judge by");
      waiting_.pop_front();
    }
  }

  const std::string name_;
  media::OutputFile output_;
  media::OutputIo io_;
  media::Codec encoder_, decoder_;
  media::OutputContext container_;
  std::deque<media::Frame> waiting_;
  std::optional<std::int64_t> first_ns_;
  std::int64_t last_ = -1;
};

void write_all(int descriptor, ByteView bytes, const std::filesystem::path& file) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) throw IoError("write", file, errno);
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
}

}  // namespace

ShownFilm write_shown_film(const std::filesystem::path& clip, ClipStretch stretch, const Coding& coding,
                           const std::filesystem::path& file, const ShownProgress& progress) {
  Clip source(clip, stretch);
  const PictureFormat own = source.format(), shown = shown_format(own);
  require_even(shown, clip);
  RoundTrip trip(coding, own, source.frame_rate());
  LosslessFilm film(file, shown, source.frame_rate());
  ShownFilm made;
  made.width = own.width;
  made.height = own.height;
  made.depth = source.depth();
  made.pictures_are = source.described();
  std::unique_ptr<FrameFilter> back, to_shown;
  std::deque<std::int64_t> times;
  std::int64_t last_ns = 0;
  const RoundTrip::Taker take = [&](media::Frame coded) {
    if (times.empty()) throw Error(coding.name() + " gave more pictures than it was given");
    coded->pts = times.front();
    // By way of the clip's own format, as it is measured (clip_trial.h).
    media::Frame picture = as_format(as_format(std::move(coded), own, back), shown, to_shown);
    film.add(std::move(picture), times.front());
    times.pop_front();
    ++made.pictures;
    if (progress) progress(made.pictures);
  };
  while (const media::Frame picture = source.next()) {
    times.push_back(last_ns = picture->pts);
    trip.put(*picture, take);
  }
  trip.finish(take);
  if (!times.empty())
    throw Error(coding.name() + " kept " + std::to_string(times.size()) + " pictures of " + clip.string());
  made.seconds = made.pictures == 0
                     ? 0
                     : static_cast<double>(last_ns) * 1e-9 +
                           double(source.frame_rate().denominator) / source.frame_rate().numerator;
  if (made.seconds < kShortestClipSeconds) {
    throw UsageError(clip.string() + " has " + number_text(made.seconds, 3) +
                     " s of pictures where it is taken; an encoder needs at least 1 s to find its rate");
  }
  film.finish();
  return made;
}

void pad_film(const std::filesystem::path& file, std::uint64_t size) {
  const std::uint64_t has = std::filesystem::file_size(file);
  if (size < has + kLeastPadding) {
    throw UsageError(file.string() + " has " + std::to_string(has) + " bytes and cannot be made one of " +
                     std::to_string(size));
  }
  const std::uint64_t box = size - has;
  constexpr std::uint64_t kLargestShort = 0xffff'ffff;
  Bytes head;
  const auto put = [&head](std::uint64_t value, int bytes) {
    for (int i = bytes; i-- > 0;) head.push_back(static_cast<std::byte>(value >> (8 * i)));
  };
  put(box > kLargestShort ? 1 : box, 4);
  append(head, bytes_of("free"));
  if (box > kLargestShort) put(box, 8);
  const Descriptor output(::open(file.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC));
  if (!output) throw IoError("open", file, errno);
  write_all(output.number(), head, file);
  Bytes unit(std::size_t{1} << 20U);
  for (std::uint64_t left = box - head.size(); left > 0;) {
    const std::span<std::byte> next(unit.data(), std::min<std::uint64_t>(left, unit.size()));
    crypto::fill_random(next);
    write_all(output.number(), next, file);
    left -= next.size();
  }
  if (::fsync(output.number()) != 0) throw IoError("flush", file, errno);
}

}  // namespace kiroku::recorder
