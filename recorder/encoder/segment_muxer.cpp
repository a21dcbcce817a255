#include "recorder/encoder/segment_muxer.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/mem.h>
#include <libavutil/opt.h>
}

#include <algorithm>
#include <array>
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
constexpr std::size_t kTransportPacketBytes = 188;
// Players recognise a transport stream by its first packets: a segment with fewer is taken for something
// else.
constexpr std::uint64_t kFewestTransportPackets = 32;
// A decoder gets a quarter of a second to buffer: PES time stamps stand that far behind the clock reference.
constexpr int kTransportStreamDelayUs = 250'000;

/// A null packet (ISO 13818-1, 2.4.3.3: identifier 0x1fff), which every demultiplexer skips.
constexpr std::array<unsigned char, kTransportPacketBytes> kNullPacket = [] {
  std::array<unsigned char, kTransportPacketBytes> packet{0x47, 0x1f, 0xff, 0x10};
  std::fill(packet.begin() + 4, packet.end(), static_cast<unsigned char>(0xff));
  return packet;
}();

/// An AVIO that hands bytes to the segment's sink, and carries the sink's exceptions over libav's C frames.
class SinkOutput {
 public:
  explicit SinkOutput(int buffer_bytes) {
    auto* buffer = static_cast<unsigned char*>(av_malloc(static_cast<std::size_t>(buffer_bytes)));
    if (buffer != nullptr) {
      context_.reset(avio_alloc_context(buffer, buffer_bytes, 1, this, nullptr, take, nullptr));
    }
    if (!context_) {
      av_free(buffer);
      throw std::bad_alloc();
    }
    context_->seekable = 0;
  }

  [[nodiscard]] AVIOContext* context() const { return context_.get(); }
  void send_to(SegmentSink sink) {
    sink_ = std::move(sink);
    sent_ = 0;
  }
  /// Bytes that left since send_to().
  [[nodiscard]] std::uint64_t sent() const { return sent_; }

  /// Checks the result of a libav call that may have written.
  void check(int result) {
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
    require(result, kAction);
  }
  void flush() {
    avio_flush(context_.get());
    check(context_->error);
  }

 private:
  /// For libav; the bytes are const from libavformat 61 on.
  template <typename Byte>
  static int take(void* self, Byte* bytes, int size) {
    auto* output = static_cast<SinkOutput*>(self);
    if (output->failure_) return AVERROR(EIO);
    try {
      if (output->sink_) output->sink_(std::as_bytes(std::span(bytes, static_cast<std::size_t>(size))));
      output->sent_ += static_cast<std::uint64_t>(size);
      return size;
    } catch (...) {
      output->failure_ = std::current_exception();
      return AVERROR(EIO);
    }
  }

  media::CustomIo context_;
  SegmentSink sink_;
  std::uint64_t sent_ = 0;
  std::exception_ptr failure_;
};

AVRational rational(Rational value) { return {value.numerator, value.denominator}; }

std::string text_of(AVRational time_base) {
  return std::to_string(time_base.num) + "/" + std::to_string(time_base.den);
}

/// What both containers have in common.
class LibavMuxer : public SegmentMuxer {
 public:
  void write(media::Packet packet, int stream) override {
    packet->stream_index = stream;
    av_packet_rescale_ts(packet.get(), time_bases_[static_cast<std::size_t>(stream)],
                         output_->streams[stream]->time_base);
    sink_.check(av_write_frame(output_.get(), packet.get()));
  }

 protected:
  explicit LibavMuxer(int buffer_bytes) : sink_(buffer_bytes) {}

  void use(const std::vector<MuxedStream>& streams) {
    time_bases_.clear();
    for (const MuxedStream& stream : streams) time_bases_.push_back(rational(stream.time_base));
  }

  [[nodiscard]] media::OutputContext make_output(const char* format,
                                                 const std::vector<MuxedStream>& streams) {
    AVFormatContext* raw = nullptr;
    require(avformat_alloc_output_context2(&raw, nullptr, format, nullptr), kAction);
    media::OutputContext output(raw);
    output->pb = sink_.context();
    output->flags |= AVFMT_FLAG_CUSTOM_IO | AVFMT_FLAG_BITEXACT;
    // Time stamps are the case's: nothing may be shifted.
    output->avoid_negative_ts = AVFMT_AVOID_NEG_TS_DISABLED;
    for (const MuxedStream& muxed : streams) {
      AVStream* stream = avformat_new_stream(output.get(), nullptr);
      if (stream == nullptr) throw std::bad_alloc();
      require(avcodec_parameters_from_context(stream->codecpar, muxed.encoder), kAction);
      stream->time_base = rational(muxed.time_base);
      stream->avg_frame_rate = muxed.encoder->framerate;
      stream->sample_aspect_ratio = muxed.encoder->sample_aspect_ratio;
    }
    return output;
  }

  std::vector<AVRational> time_bases_;
  SinkOutput sink_;
  media::OutputContext output_;
};

class TransportStreamMuxer : public LibavMuxer {
 public:
  TransportStreamMuxer() : LibavMuxer(kTransportStreamBuffer) {}
  ~TransportStreamMuxer() override {
    // The trailer of MPEG-TS is empty; what it would flush has nowhere to go.
    sink_.send_to({});
    if (output_) av_write_trailer(output_.get());
  }

  void begin(const std::vector<MuxedStream>& streams, SegmentSink sink) override {
    sink_.send_to(std::move(sink));
    use(streams);
    if (!output_) {
      auto output = make_output("mpegts", streams);
      output->max_delay = kTransportStreamDelayUs;
      // Each picture leaves at once: what a kill finds in a buffer here is lost.
      output->flags |= AVFMT_FLAG_FLUSH_PACKETS;
      sink_.check(avformat_write_header(output.get(), nullptr));
      output_ = std::move(output);
    } else {
      require(av_opt_set(output_->priv_data, "mpegts_flags", "+resend_headers", 0), kAction);
    }
  }

  void end() override {
    sink_.check(av_write_frame(output_.get(), nullptr));
    sink_.flush();
    fill_until(kFewestTransportPackets * kTransportPacketBytes);
    sink_.send_to({});
  }

  void fill_up(std::uint64_t unit) override {
    sink_.flush();
    fill_until(sink_.sent() / unit * unit + unit + 1);
  }

  [[nodiscard]] SegmentTime stated(std::int64_t pts, Rational time_base) const override {
    // libavformat's muxer sets time stamps twice its delay after the packet's.
    constexpr AVRational kTimeBase{1, 90'000};
    return {av_rescale_q(pts, rational(time_base), kTimeBase) +
                2 * av_rescale(kTransportStreamDelayUs, kTimeBase.den, AV_TIME_BASE),
            text_of(kTimeBase)};
  }

 private:
  void fill_until(std::uint64_t bytes) {
    while (sink_.sent() < bytes) {
      avio_write(sink_.context(), kNullPacket.data(), kNullPacket.size());
      sink_.flush();
    }
  }
};

class MatroskaMuxer : public LibavMuxer {
 public:
  MatroskaMuxer() : LibavMuxer(kMatroskaBuffer) {}
  ~MatroskaMuxer() override {
    sink_.send_to({});
    if (output_) av_write_trailer(output_.get());
  }

  void begin(const std::vector<MuxedStream>& streams, SegmentSink sink) override {
    sink_.send_to(std::move(sink));
    use(streams);
    auto output = make_output("matroska", streams);
    sink_.check(avformat_write_header(output.get(), nullptr));
    output_ = std::move(output);
  }

  /// Its clusters leave as they fill, at rates at which chunks fill many times a second.
  void fill_up(std::uint64_t /*unit*/) override {}

  void end() override {
    const media::OutputContext output = std::move(output_);
    sink_.check(av_write_trailer(output.get()));
    sink_.flush();
    sink_.send_to({});
  }

  [[nodiscard]] SegmentTime stated(std::int64_t pts, Rational time_base) const override {
    constexpr AVRational kTimeBase{1, 1000};
    return {av_rescale_q(pts, rational(time_base), kTimeBase), text_of(kTimeBase)};
  }
};

}  // namespace

std::unique_ptr<SegmentMuxer> make_transport_stream_muxer() {
  return std::make_unique<TransportStreamMuxer>();
}

std::unique_ptr<SegmentMuxer> make_matroska_muxer() { return std::make_unique<MatroskaMuxer>(); }

}  // namespace kiroku::recorder
