#include "recorder/source/ffmpeg_source.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavdevice/avdevice.h>
#include <libavformat/avformat.h>
#include <libavutil/pixdesc.h>
}

#include <filesystem>
#include <mutex>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

using media::require;

constexpr std::int64_t kOpenTimeoutNs = 15'000'000'000;
// A live source that sends nothing for this long is lost: torn down and opened anew.
constexpr std::int64_t kStallTimeoutNs = 5'000'000'000;
// A file whose time stamps jump further than this is taken to go on where it was.
constexpr std::int64_t kLargestJumpNs = 10'000'000'000;

class FfmpegSource : public Source {
 public:
  FfmpegSource(const SourceAddress& address, const CaseClock& clock) : address_(address), clock_(clock) {
    live_ = address.kind != SourceKind::kFile;
    loop_ = integer_option(address, "loop", 0, 0, 1) == 1;
    open();
  }

  [[nodiscard]] PictureFormat format() const override { return format_; }
  [[nodiscard]] Rational frame_rate() const override { return rate_; }
  [[nodiscard]] bool is_live() const override { return live_; }

  std::optional<TimedFrame> read() override {
    // The picture that open() looked at came before recording began.
    if (live_) first_frame_.reset();
    while (!interrupted()) {
      media::Frame frame = first_frame_ ? std::move(first_frame_) : decode();
      if (!frame) {
        if (live_ && !interrupted()) throw Error("source '" + address_.stated + "' ended");
        if (!loop_ || interrupted()) return {};
        rewind();
        continue;
      }
      TimedFrame timed;
      if (live_) {
        timed.time_ns =
            std::max(std::min<std::int64_t>(frame->reordered_opaque, clock_.now_ns()), last_time_ns_);
      } else {
        timed.time_ns = file_time_ns(*frame);
        if (!address_.unpaced() && !wait_until(clock_, timed.time_ns, interruption())) return {};
      }
      last_time_ns_ = timed.time_ns;
      timed.frame = std::move(frame);
      return timed;
    }
    return {};
  }

 private:
  static int must_stop(void* self) {
    const auto* source = static_cast<FfmpegSource*>(self);
    return source->interrupted() || source->clock_.now_ns() > source->deadline_ns_ ? 1 : 0;
  }

  void open() {
    std::error_code ignored;
    if (address_.kind == SourceKind::kFile && std::filesystem::file_size(address_.location, ignored) == 0) {
      throw UsageError("source '" + address_.stated + "' is an empty file");
    }
    media::Options options;
    const AVInputFormat* input_format = nullptr;
    if (address_.kind == SourceKind::kDevice) {
      address_.require_options("size,rate,format");
      static std::once_flag registered;
      std::call_once(registered, avdevice_register_all);
      input_format = av_find_input_format("video4linux2");
      if (input_format == nullptr)
        throw Error("this libavdevice has no video4linux2; source '" + address_.stated +
                    "' cannot be opened");
      if (address_.options.contains("size")) options.set("video_size", address_.option("size", ""));
      if (address_.options.contains("rate")) options.set("framerate", address_.option("rate", ""));
      if (address_.options.contains("format")) options.set("input_format", address_.option("format", ""));
    } else if (address_.kind != SourceKind::kNetwork) {
      address_.require_options("speed,loop");
    }
    if (address_.location.starts_with("rtsp")) options.set("rtsp_transport", "tcp");
    // A hole in a transport stream costs fewer frames when the demuxer searches further for its next packet.
    options.set("resync_size", "1000000");

    deadline_ns_ = clock_.now_ns() + kOpenTimeoutNs;
    AVFormatContext* raw = avformat_alloc_context();
    if (raw == nullptr) throw std::bad_alloc();
    raw->interrupt_callback = {must_stop, this};
    if (live_) raw->flags |= AVFMT_FLAG_NOBUFFER;
    // A bare path must not be mistaken for a protocol ("a:b.mp4").
    const std::string location = address_.kind == SourceKind::kFile || address_.kind == SourceKind::kPipe
                                     ? "file:" + address_.location
                                     : address_.location;
    const int opened = avformat_open_input(&raw, location.c_str(), input_format, options.address());
    if (opened < 0) {
      const bool late = clock_.now_ns() > deadline_ns_;
      throw Error("source '" + address_.stated + "' cannot be opened: " +
                  (late                            ? "it did not answer within 15 s"
                   : opened == AVERROR_INVALIDDATA ? "it is no video that libavformat knows"
                                                   : media::libav_error_text(opened)));
    }
    input_.reset(raw);
    require(avformat_find_stream_info(input_.get(), nullptr), "cannot read source '" + address_.stated + "'");
    const AVCodec* decoder = nullptr;
    stream_ = av_find_best_stream(input_.get(), AVMEDIA_TYPE_VIDEO, -1, -1, &decoder, 0);
    if (stream_ < 0) throw Error("source '" + address_.stated + "' holds no video");
    const AVStream* stream = input_->streams[stream_];
    for (unsigned i = 0; i < input_->nb_streams; ++i) {
      if (static_cast<int>(i) != stream_) input_->streams[i]->discard = AVDISCARD_ALL;
    }
    decoder_.reset(avcodec_alloc_context3(decoder));
    if (!decoder_) throw std::bad_alloc();
    require(avcodec_parameters_to_context(decoder_.get(), stream->codecpar),
            "cannot decode source '" + address_.stated + "'");
    decoder_->pkt_timebase = stream->time_base;
    decoder_->thread_count = 2;
    // Frame threads hold frames back: a live picture would arrive late.
    decoder_->thread_type = live_ ? FF_THREAD_SLICE : FF_THREAD_FRAME | FF_THREAD_SLICE;
    require(avcodec_open2(decoder_.get(), decoder, nullptr),
            "cannot decode source '" + address_.stated + "'");
    const AVRational rate = av_guess_frame_rate(input_.get(), input_->streams[stream_], nullptr);
    rate_ = rate.num > 0 && rate.den > 0 ? Rational{rate.num, rate.den} : Rational{25, 1};
    // The first picture tells what the container may not: its real size and format.
    first_frame_ = decode();
    if (!first_frame_) throw Error("source '" + address_.stated + "' holds no picture that can be decoded");
    format_ = format_of(*first_frame_);
  }

  /// The next decoded picture, nothing at the end. Damaged packets are skipped, as long as the input goes on.
  media::Frame decode() {
    media::Frame frame = media::make_frame();
    const media::Packet packet = media::make_packet();
    for (;;) {
      const int received = avcodec_receive_frame(decoder_.get(), frame.get());
      if (received == 0) return frame;
      if (received == AVERROR_EOF) return {};
      if (received != AVERROR(EAGAIN)) require(received, "cannot decode source '" + address_.stated + "'");
      deadline_ns_ = clock_.now_ns() + kStallTimeoutNs;
      const int read = av_read_frame(input_.get(), packet.get());
      if (read == AVERROR_EOF || interrupted()) {
        (void)avcodec_send_packet(decoder_.get(), nullptr);
        continue;
      }
      if (read == AVERROR_EXIT) throw Error("source '" + address_.stated + "' sent nothing for 5 s");
      require(read, "cannot read on from source '" + address_.stated + "'");
      if (packet->stream_index == stream_) {
        decoder_->reordered_opaque = clock_.now_ns();
        (void)avcodec_send_packet(decoder_.get(),
                                  packet.get());  // a damaged packet is the decoder's to conceal or skip
      }
      av_packet_unref(packet.get());
    }
  }

  void rewind() {
    require(av_seek_frame(input_.get(), -1, input_->start_time == AV_NOPTS_VALUE ? 0 : input_->start_time,
                          AVSEEK_FLAG_BACKWARD),
            "cannot play source '" + address_.stated + "' again from its start");
    avcodec_flush_buffers(decoder_.get());
    last_pts_ns_.reset();
  }

  [[nodiscard]] std::int64_t frame_duration_ns() const {
    return 1'000'000'000LL * rate_.denominator / rate_.numerator;
  }

  /// The file's own time line, beginning at 0 and always going forward, over loops and jumps.
  std::int64_t file_time_ns(const AVFrame& frame) {
    const std::int64_t pts = frame.best_effort_timestamp;
    const std::int64_t step = frame_duration_ns();
    if (pts == AV_NOPTS_VALUE) return next_file_time_ns_ = frames_read_++ == 0 ? 0 : last_time_ns_ + step;
    const std::int64_t pts_ns =
        av_rescale_q(pts, input_->streams[stream_]->time_base, AVRational{1, 1'000'000'000});
    std::int64_t advance = frames_read_ == 0 ? 0 : step;
    if (last_pts_ns_) {
      const std::int64_t difference = pts_ns - *last_pts_ns_;
      if (difference > 0 && difference < kLargestJumpNs) advance = difference;
    }
    last_pts_ns_ = pts_ns;
    ++frames_read_;
    return next_file_time_ns_ += advance;
  }

  SourceAddress address_;
  const CaseClock& clock_;
  bool live_ = false;
  bool loop_ = false;
  std::int64_t deadline_ns_ = 0;
  media::InputContext input_;
  media::Codec decoder_;
  int stream_ = -1;
  PictureFormat format_;
  Rational rate_;
  media::Frame first_frame_;
  std::int64_t last_time_ns_ = 0;
  std::optional<std::int64_t> last_pts_ns_;
  std::int64_t next_file_time_ns_ = 0;
  std::uint64_t frames_read_ = 0;
};

}  // namespace

std::unique_ptr<Source> open_ffmpeg_source(const SourceAddress& address, const CaseClock& clock) {
  return std::make_unique<FfmpegSource>(address, clock);
}

}  // namespace kiroku::recorder
