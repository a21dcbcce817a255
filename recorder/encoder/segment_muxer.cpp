#include "recorder/encoder/segment_muxer.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/mem.h>
#include <libavutil/opt.h>
}

#include <exception>
#include <span>
#include <utility>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

using media::require;

constexpr const char* kAction = "cannot write a segment";
constexpr int kTransportStreamBuffer = 64 << 10;
constexpr int kMatroskaBuffer = 1 << 20;
// A decoder gets a quarter of a second to buffer: PES time stamps stand that far behind the clock reference.
constexpr int kTransportStreamDelayUs = 250'000;

/// An AVIO that hands bytes to the segment's sink, and carries the sink's exceptions over libav's C frames.
class SinkOutput {
 public:
  explicit SinkOutput(int buffer_size) {
    auto* buffer = static_cast<unsigned char*>(av_malloc(static_cast<std::size_t>(buffer_size)));
    if (buffer == nullptr) throw std::bad_alloc();
    context_ = avio_alloc_context(buffer, buffer_size, 1, this, nullptr, take, nullptr);
    if (context_ == nullptr) {
      av_free(buffer);
      throw std::bad_alloc();
    }
    context_->seekable = 0;
  }
  ~SinkOutput() {
    av_freep(static_cast<void*>(&context_->buffer));
    avio_context_free(&context_);
  }
  SinkOutput(const SinkOutput&) = delete;
  SinkOutput& operator=(const SinkOutput&) = delete;

  [[nodiscard]] AVIOContext* context() const { return context_; }
  void send_to(SegmentSink sink) { sink_ = std::move(sink); }

  /// Checks the result of a libav call that may have written.
  void check(int result) {
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
    require(result, kAction);
  }
  void flush() {
    avio_flush(context_);
    check(context_->error);
  }

 private:
  static int take(void* self, std::uint8_t* bytes, int size) {
    auto* output = static_cast<SinkOutput*>(self);
    if (output->failure_) return AVERROR(EIO);
    try {
      if (output->sink_) output->sink_(std::as_bytes(std::span(bytes, static_cast<std::size_t>(size))));
      return size;
    } catch (...) {
      output->failure_ = std::current_exception();
      return AVERROR(EIO);
    }
  }

  AVIOContext* context_ = nullptr;
  SegmentSink sink_;
  std::exception_ptr failure_;
};

media::OutputContext make_output(const char* format, AVIOContext* io,
                                 const std::vector<const AVCodecContext*>& encoders) {
  AVFormatContext* raw = nullptr;
  require(avformat_alloc_output_context2(&raw, nullptr, format, nullptr), kAction);
  media::OutputContext output(raw);
  output->pb = io;
  output->flags |= AVFMT_FLAG_CUSTOM_IO | AVFMT_FLAG_BITEXACT;
  // Time stamps are the case's: nothing may be shifted.
  output->avoid_negative_ts = AVFMT_AVOID_NEG_TS_DISABLED;
  for (const AVCodecContext* encoder : encoders) {
    AVStream* stream = avformat_new_stream(output.get(), nullptr);
    if (stream == nullptr) throw std::bad_alloc();
    require(avcodec_parameters_from_context(stream->codecpar, encoder), kAction);
    stream->time_base = encoder->time_base;
    stream->avg_frame_rate = encoder->framerate;
    stream->sample_aspect_ratio = encoder->sample_aspect_ratio;
  }
  return output;
}

std::string text_of(AVRational time_base) {
  return std::to_string(time_base.num) + "/" + std::to_string(time_base.den);
}

class TransportStreamMuxer : public SegmentMuxer {
 public:
  explicit TransportStreamMuxer(const std::vector<const AVCodecContext*>& encoders)
      : encoders_(encoders),
        sink_(kTransportStreamBuffer),
        output_(make_output("mpegts", sink_.context(), encoders)) {
    output_->max_delay = kTransportStreamDelayUs;
  }
  ~TransportStreamMuxer() override {
    // The trailer of MPEG-TS is empty; what it would flush has nowhere to go.
    sink_.send_to({});
    if (begun_) av_write_trailer(output_.get());
  }

  void begin(SegmentSink sink) override {
    sink_.send_to(std::move(sink));
    if (!begun_) {
      sink_.check(avformat_write_header(output_.get(), nullptr));
      begun_ = true;
    } else {
      require(av_opt_set(output_->priv_data, "mpegts_flags", "+resend_headers", 0), kAction);
    }
  }

  void write(media::Packet packet, int stream) override {
    packet->stream_index = stream;
    av_packet_rescale_ts(packet.get(), encoders_[static_cast<std::size_t>(stream)]->time_base,
                         output_->streams[stream]->time_base);
    sink_.check(av_write_frame(output_.get(), packet.get()));
  }

  void end() override {
    sink_.check(av_write_frame(output_.get(), nullptr));
    sink_.flush();
    sink_.send_to({});
  }

  [[nodiscard]] SegmentTime stated(std::int64_t encoder_pts) const override {
    // libavformat's muxer sets PES time stamps twice its delay after the packet's.
    constexpr AVRational kTimeBase{1, 90'000};
    return {av_rescale_q(encoder_pts, encoders_[0]->time_base, kTimeBase) +
                2 * av_rescale(kTransportStreamDelayUs, 90'000, AV_TIME_BASE),
            text_of(kTimeBase)};
  }

 private:
  std::vector<const AVCodecContext*> encoders_;
  SinkOutput sink_;
  media::OutputContext output_;
  bool begun_ = false;
};

class MatroskaMuxer : public SegmentMuxer {
 public:
  explicit MatroskaMuxer(const std::vector<const AVCodecContext*>& encoders)
      : encoders_(encoders), sink_(kMatroskaBuffer) {}
  ~MatroskaMuxer() override {
    sink_.send_to({});
    if (output_) av_write_trailer(output_.get());
  }

  void begin(SegmentSink sink) override {
    sink_.send_to(std::move(sink));
    output_ = make_output("matroska", sink_.context(), encoders_);
    sink_.check(avformat_write_header(output_.get(), nullptr));
  }

  void write(media::Packet packet, int stream) override {
    packet->stream_index = stream;
    av_packet_rescale_ts(packet.get(), encoders_[static_cast<std::size_t>(stream)]->time_base,
                         output_->streams[stream]->time_base);
    sink_.check(av_write_frame(output_.get(), packet.get()));
  }

  void end() override {
    const media::OutputContext output = std::move(output_);
    sink_.check(av_write_trailer(output.get()));
    sink_.flush();
    sink_.send_to({});
  }

  [[nodiscard]] SegmentTime stated(std::int64_t encoder_pts) const override {
    constexpr AVRational kTimeBase{1, 1000};
    return {av_rescale_q(encoder_pts, encoders_[0]->time_base, kTimeBase), text_of(kTimeBase)};
  }

 private:
  std::vector<const AVCodecContext*> encoders_;
  SinkOutput sink_;
  media::OutputContext output_;
};

}  // namespace

std::unique_ptr<SegmentMuxer> make_transport_stream_muxer(
    const std::vector<const AVCodecContext*>& encoders) {
  return std::make_unique<TransportStreamMuxer>(encoders);
}

std::unique_ptr<SegmentMuxer> make_matroska_muxer(const std::vector<const AVCodecContext*>& encoders) {
  return std::make_unique<MatroskaMuxer>(encoders);
}

}  // namespace kiroku::recorder
