#include "recorder/source/ffmpeg_source.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/parseutils.h>
#include <libavutil/pixdesc.h>
}

#include <algorithm>
#include <array>
#include <filesystem>
#include <thread>

#include "base/error.h"
#include "media/libav_versions.h"
#include "recorder/source/fifo_input.h"
#include "recorder/source/file_input.h"
#include "recorder/source/resolved_location.h"
#include "recorder/source/source_box.h"
#include "recorder/source/v4l2_format.h"

namespace kiroku::recorder {
namespace {

using media::require;

// libavdevice keeps its descriptor to itself, so a device is asked this often whether it has a picture.
constexpr std::chrono::milliseconds kDeviceInterval{1};
// What is lost on the way of a live source lies within this.
constexpr std::int64_t kLongestLossNs = 10'000'000'000;
// A decoder gives pictures some packets after it took them in.
constexpr int kPicturesOfDamage = 16;
// A server is asked for them in this order.
struct RtspTransport {
  const char *asked, *libav, *name;
};
constexpr std::array<RtspTransport, 3> kRtspTransports{
    {{"tcp", "tcp", "TCP"}, {"udp", "udp", "UDP"}, {"multicast", "udp_multicast", "multicast"}}};
constexpr AVRational kNanoseconds{1, 1'000'000'000};

/// Not kCertain where the codec has a mode without loss, unless the profile rules that out.
CodingLoss loss_of(const AVCodecContext& decoder) {
  switch (decoder.codec_id) {
    case AV_CODEC_ID_H264:
      // ITU-T H.264, 7.4.2.1.1: transform bypass exists in the profiles of 4:4:4 prediction alone.
      return decoder.profile == FF_PROFILE_UNKNOWN ||
                     decoder.profile == FF_PROFILE_H264_HIGH_444_PREDICTIVE ||
                     decoder.profile == FF_PROFILE_H264_CAVLC_444
                 ? CodingLoss::kPossible
                 : CodingLoss::kCertain;
    case AV_CODEC_ID_HEVC:
    case AV_CODEC_ID_VP9:
    case AV_CODEC_ID_AV1:
      return CodingLoss::kPossible;  // libavcodec describes them as lossy only
    default:
      break;
  }
  const AVCodecDescriptor* const described = avcodec_descriptor_get(decoder.codec_id);
  if (described == nullptr) return CodingLoss::kUnknown;
  const bool lossless = (described->props & AV_CODEC_PROP_LOSSLESS) != 0;
  if ((described->props & AV_CODEC_PROP_LOSSY) != 0)
    return lossless ? CodingLoss::kPossible : CodingLoss::kCertain;
  return lossless ? CodingLoss::kNone : CodingLoss::kUnknown;
}

class FfmpegSource : public Source {
 public:
  FfmpegSource(const SourceAddress& address, const CaseClock& clock, const OpeningTerms& terms)
      : address_(address),
        clock_(clock),
        cancelled_(terms.cancelled),
        pulse_(terms.pulse),
        silence_ns_(terms.silence.count()),
        name_("source '" + address.stated + "'"),
        box_(terms.box),
        told_(terms.remark),
        live_(address.kind != SourceKind::kFile),
        wants_sound_(terms.sound),
        loop_(integer_option(address, "loop", 0, 0, 1) == 1) {
    deadline_ns_ = clock_.now_ns() + terms.patience.count();
    open_input();
    open_decoder();
    // The first picture tells what the container may not: its real size and format.
    do {
      first_frame_ = decode();
    } while (first_frame_ && is_sound(*first_frame_));
    if (!first_frame_) throw Error(name_ + " holds no picture that can be decoded");
    format_ = format_of(*first_frame_);
    treatment_at_opening_ = treatment_;
    if (const std::string turn = turn_text(treatment_); !turn.empty())
      remark_ += (remark_.empty() ? "" : "; ") + name_ + ": " + turn;
    cancelled_ = nullptr;
    opening_ = false;
    if (address_.kind == SourceKind::kDevice) compare_with_asked();
  }

  [[nodiscard]] PictureFormat format() const override { return format_; }
  [[nodiscard]] Rational frame_rate() const override { return rate_; }
  [[nodiscard]] std::optional<SoundFormat> sound_format() const override {
    if (!sound_decoder_) return {};
    return SoundFormat{sound_decoder_->sample_rate, sound_decoder_->ch_layout.nb_channels,
                       sound_decoder_->sample_fmt};
  }
  [[nodiscard]] bool is_live() const override { return live_; }
  [[nodiscard]] bool is_unboxed() const override { return box_ == nullptr; }
  [[nodiscard]] std::string remark() const override {
    return remark_ + (remark_.empty() || told_.empty() ? "" : "; ") + told_;
  }
  [[nodiscard]] std::string input() const override {
    char rate[32];
    std::snprintf(rate, sizeof rate, ", %.4g a second", double(rate_.numerator) / double(rate_.denominator));
    return format_.to_string() + rate + (transport_.empty() ? "" : ", RTSP over " + transport_);
  }

  [[nodiscard]] PictureTreatment treatment() const override { return treatment_at_opening_; }
  [[nodiscard]] SourceCoding coding() const override {
    return {avcodec_get_name(decoder_->codec_id), loss_of(*decoder_)};
  }

  std::optional<TimedFrame> read() override {
    // The picture that opening looked at came before recording began.
    if (live_) first_frame_.reset();
    bool rewound = false;
    while (!interrupted()) {
      media::Frame frame = first_frame_ ? std::move(first_frame_) : decode();
      if (!frame) {
        if (live_ && !interrupted()) throw Error(name_ + " ended");
        if (!loop_ || rewound || interrupted()) return {};
        rewind();
        rewound = true;
        continue;
      }
      TimedFrame timed;
      timed.is_sound = is_sound(*frame);
      if (timed.is_sound) {
        timed.time_ns = sound_time_ns(*frame);
        timed.frame = std::move(frame);
        if (timed.time_ns < 0) continue;  // before the first picture
        return timed;
      }
      if (live_) {
        timed.time_ns = std::max(std::min(media::number_of(*frame), clock_.now_ns()), last_time_ns_ + 1);
        timed.lost_before = lost_on_the_way_before(*frame);
        timed.lost_on_the_way = true;
      } else {
        timed.time_ns = file_time_ns(*frame, timed.time_break);
        if (timed.time_break != TimeBreak::kNone) {
          timed.lost_before = 1;
          timed.lost_on_the_way = true;
        }
        if (!address_.unpaced() && !wait_until(clock_, timed.time_ns, interruption(), pulse_)) return {};
      }
      last_time_ns_ = timed.time_ns;
      timed.treatment = treatment_;
      timed.frame = std::move(frame);
      return timed;
    }
    return {};
  }

 private:
  static int must_stop(void* self) { return static_cast<FfmpegSource*>(self)->must_stop() ? 1 : 0; }
  [[nodiscard]] bool must_stop() const {
    const bool stop =
        interrupted() || (cancelled_ != nullptr && *cancelled_) || (live_ && clock_.now_ns() > deadline_ns_);
    // What goes on waiting though it must stop gives no sign of life.
    if (!stop && pulse_ != nullptr) ++*pulse_;
    return stop;
  }

  [[nodiscard]] media::Options options_for_input(const AVInputFormat*& format) const {
    media::Options options;
    if (address_.kind == SourceKind::kDevice) {
      address_.require_options("size,rate,format");
      format = v4l2_input_format();
      if (address_.options.contains("size")) options.set("video_size", address_.option("size", ""));
      if (address_.options.contains("rate")) options.set("framerate", address_.option("rate", ""));
      if (address_.options.contains("format")) options.set("input_format", address_.option("format", ""));
    } else if (address_.kind == SourceKind::kPipe) {
      address_.require_options("");
    } else if (address_.kind == SourceKind::kFile) {
      address_.require_options("speed,loop");
    }
    if (box_ != nullptr && address_.location.starts_with("http"))
      options.set("headers", "Host: " + host_and_port(address_.location) + "\r\n");
    if (address_.location.starts_with("udp")) {
      // A moment's delay must not end the stream; what is lost shows in the pictures.
      options.set("overrun_nonfatal", "1");
      options.set("fifo_size", "65536");
    }
    // A hole in a transport stream costs fewer frames when the demuxer searches further for its next packet.
    options.set("resync_size", "1000000");
    return options;
  }

  void open_input() {
    std::error_code ignored;
    if (address_.kind == SourceKind::kFile && std::filesystem::file_size(address_.location, ignored) == 0) {
      throw UsageError(name_ + " is an empty file; give one that holds a film");
    }
    prepare_input();
    if (address_.location.starts_with("rtsp")) {
      open_rtsp();
    } else if (const int opened = try_to_open(nullptr); opened < 0) {
      throw Error(name_ + " cannot be opened: " + why_not_opened(opened));
    }
    // A device says by itself what it gives; asked without waiting, libavformat would look in a busy loop.
    if (address_.kind == SourceKind::kDevice) {
      if (box_ != nullptr) box_->close();
      return;
    }
    const int described = avformat_find_stream_info(input_.get(), nullptr);
    if (described < 0) throw Error(name_ + " cannot be opened: " + why_not_opened(described));
  }

  /// Opens what only a path or a name leads to. Then the box, if it works in one, is closed, before the first
  /// byte that somebody else chose; but libavdevice opens a device by itself, and reads nothing of it then.
  void prepare_input() {
    locations_ = {address_.location};
    if (address_.kind == SourceKind::kDevice) return;
    if (address_.kind == SourceKind::kPipe) {
      fifo_ = std::make_unique<FifoInput>(address_.location, [this] { return must_stop(); });
    } else if (address_.kind == SourceKind::kFile) {
      file_ = std::make_unique<FileInput>(address_.location, [this] { return must_stop(); });
      locations_ = {"file:" + address_.location};  // a path must not be mistaken for a protocol ("a:b.mp4")
    } else if (box_ != nullptr) {
      locations_ = resolved_locations(address_.location);
    }
    if (box_ != nullptr) box_->close();
  }

  /// Over the transport that the address names, or the first of all that the server offers. What libavformat
  /// tries by itself, it does not tell.
  void open_rtsp() {
    const std::string asked = address_.option("transport", "");
    std::string refused;
    for (const RtspTransport& transport : kRtspTransports) {
      if (!asked.empty() && asked != transport.asked) continue;
      // Over TLS there is TCP alone.
      if (asked.empty() && address_.location.starts_with("rtsps") && !refused.empty()) break;
      const int opened = try_to_open(transport.libav);
      if (opened >= 0) {
        transport_ = transport.name;
        if (!refused.empty()) {
          remark_ = name_ + " comes over " + transport_ +
                    ", where what the network loses is not sent again: its server offers no " + refused;
        }
        return;
      }
      if (opened != AVERROR(EPROTONOSUPPORT)) {
        throw Error(name_ + " cannot be opened: " + why_not_opened(opened));
      }
      refused += (refused.empty() ? "" : " or ") + std::string(transport.name);
    }
    throw Error(name_ + " cannot be opened: its server does not offer RTSP over " + refused);
  }

  /// What avformat_open_input() says; `rtsp_transport` is its option, null for what is not RTSP.
  int try_to_open(const char* rtsp_transport) {
    int opened = 0;
    for (const std::string& location : locations_) {
      opened = try_to_open(location, rtsp_transport);
      // As libavformat does where it looks names up itself: the host may answer at another address.
      if (opened != AVERROR(ECONNREFUSED) && opened != AVERROR(ENETUNREACH) &&
          opened != AVERROR(EHOSTUNREACH))
        break;
    }
    return opened;
  }
  int try_to_open(const std::string& location, const char* rtsp_transport) {
    const AVInputFormat* input_format = nullptr;
    media::Options options = options_for_input(input_format);
    if (rtsp_transport != nullptr) options.set("rtsp_transport", rtsp_transport);
    AVFormatContext* raw = avformat_alloc_context();
    if (raw == nullptr) throw std::bad_alloc();
    raw->interrupt_callback = {must_stop, this};
    if (live_) raw->flags |= AVFMT_FLAG_NOBUFFER;
    // libavdevice asks no callback while it waits in the driver, so it may not wait there.
    if (address_.kind == SourceKind::kDevice) raw->flags |= AVFMT_FLAG_NONBLOCK;
    if (fifo_) raw->pb = fifo_->context();
    if (file_) raw->pb = file_->context();
    const int opened = avformat_open_input(&raw, location.c_str(), input_format, options.address());
    if (opened >= 0) input_.reset(raw);
    return opened;
  }

  [[nodiscard]] std::string why_not_opened(int code) const {
    if (live_ && clock_.now_ns() > deadline_ns_) return "nothing came in time; check that it is sending";
    if (code == AVERROR_INVALIDDATA || code == AVERROR_EOF) return "it holds no video that libavformat knows";
    return media::libav_error_text(code);
  }

  void open_decoder() {
    const AVCodec* decoder = nullptr;
    stream_ = av_find_best_stream(input_.get(), AVMEDIA_TYPE_VIDEO, -1, -1, &decoder, 0);
    if (stream_ < 0) throw Error(name_ + " holds no video");
    AVStream* stream = input_->streams[stream_];
    if (wants_sound_) open_sound_decoder();
    for (unsigned i = 0; i < input_->nb_streams; ++i) {
      const int index = static_cast<int>(i);
      if (index != stream_ && index != sound_stream_) input_->streams[i]->discard = AVDISCARD_ALL;
    }
    if (const std::int32_t* const matrix = media::display_matrix_of(*stream))
      turn_of_stream_ = turn_of(matrix);
    const std::string action = "cannot decode " + name_;
    decoder_.reset(avcodec_alloc_context3(decoder));
    if (!decoder_) throw std::bad_alloc();
    require(avcodec_parameters_to_context(decoder_.get(), stream->codecpar), action);
    decoder_->pkt_timebase = stream->time_base;
    decoder_->thread_count = 2;
    media::carry_numbers(*decoder_);
    // Frame threads hold frames back: a live picture would arrive late.
    decoder_->thread_type = live_ ? FF_THREAD_SLICE : FF_THREAD_FRAME | FF_THREAD_SLICE;
    if (box_ != nullptr) box_->lend(*decoder_);
    require(avcodec_open2(decoder_.get(), decoder, nullptr), action);
    const AVRational rate = av_guess_frame_rate(input_.get(), stream, nullptr);
    rate_ = {rate.num, rate.den};
    if (!is_believable(rate_)) rate_ = {25, 1};
  }

  /// A driver gives what is nearest to what it is asked for, and libavdevice takes it.
  void compare_with_asked() {
    const std::string size = std::to_string(format_.width) + "x" + std::to_string(format_.height);
    const std::string asked_size = address_.option("size", size);
    int width = 0;
    int height = 0;
    const bool same_size = av_parse_video_size(&width, &height, asked_size.c_str()) >= 0 &&
                           width == format_.width && height == format_.height;
    AVRational asked_rate{rate_.numerator, rate_.denominator};
    const bool rate_named = address_.options.contains("rate");
    if (rate_named) (void)av_parse_video_rate(&asked_rate, address_.option("rate", "").c_str());
    const bool same_rate = av_cmp_q(asked_rate, {rate_.numerator, rate_.denominator}) == 0;
    if (same_size && same_rate) return;
    remark_ = name_ + " was asked for";
    if (!same_size) remark_ += " " + asked_size + (same_rate ? "" : ",");
    if (!same_rate) remark_ += " " + address_.option("rate", "") + " pictures a second";
    remark_ += ", which it does not offer: recorded is " + input();
  }

  void open_sound_decoder() {
    const AVCodec* decoder = nullptr;
    sound_stream_ = av_find_best_stream(input_.get(), AVMEDIA_TYPE_AUDIO, -1, stream_, &decoder, 0);
    if (sound_stream_ < 0) return;
    const AVStream* stream = input_->streams[sound_stream_];
    sound_decoder_.reset(avcodec_alloc_context3(decoder));
    if (!sound_decoder_) throw std::bad_alloc();
    const std::string action = "cannot decode the sound of " + name_;
    require(avcodec_parameters_to_context(sound_decoder_.get(), stream->codecpar), action);
    sound_decoder_->pkt_timebase = stream->time_base;
    media::carry_numbers(*sound_decoder_);
    require(avcodec_open2(sound_decoder_.get(), decoder, nullptr), action);
    if (sound_decoder_->sample_rate >= kSlowestSound && sound_decoder_->sample_rate <= kFastestSound) return;
    remark_ += (remark_.empty() ? "" : "; ") + name_ + " has sound of " +
               std::to_string(sound_decoder_->sample_rate) + " samples a second, which is left out";
    sound_decoder_.reset();
    sound_stream_ = -1;
  }

  [[nodiscard]] static bool can_be_taken(const AVFrame& sound) {
    return sound.sample_rate >= kSlowestSound && sound.sample_rate <= kFastestSound &&
           sound.nb_samples <= sound.sample_rate * kLongestSoundSeconds;
  }
  [[nodiscard]] static bool is_sound(const AVFrame& frame) { return frame.nb_samples > 0; }

  /// The next decoded picture or sound, nothing at the end. Damaged packets are the decoder's to conceal or
  /// skip, as long as the input goes on.
  media::Frame decode() {
    media::Frame frame = media::make_frame();
    const media::Packet packet = media::make_packet();
    for (;;) {
      const int received = avcodec_receive_frame(decoder_.get(), frame.get());
      if (received == 0) {
        state_range_apart(*frame);
        return as_shown(std::move(frame));
      }
      if (sound_decoder_ && avcodec_receive_frame(sound_decoder_.get(), frame.get()) == 0) {
        if (can_be_taken(*frame)) return frame;
        continue;
      }
      if (received == AVERROR_EOF) return {};
      if (received != AVERROR(EAGAIN)) require(received, "cannot decode " + name_);
      if (!opening_) deadline_ns_ = clock_.now_ns() + silence_ns_;
      const int read = next_packet(*packet);
      if (read == AVERROR_EOF || interrupted()) {
        (void)avcodec_send_packet(decoder_.get(), nullptr);
        if (sound_decoder_) (void)avcodec_send_packet(sound_decoder_.get(), nullptr);
        continue;
      }
      if (read == AVERROR_EXIT) throw Error(name_ + " sent nothing for too long; check its cable or network");
      require(read, "cannot read on from " + name_);
      if (packet->stream_index == stream_) {
        if ((packet->flags & AV_PKT_FLAG_CORRUPT) != 0) damage_concerns_ = kPicturesOfDamage;
        media::set_number(*decoder_, *packet, clock_.now_ns());
        (void)avcodec_send_packet(decoder_.get(), packet.get());
      } else if (sound_decoder_ && packet->stream_index == sound_stream_) {
        media::set_number(*sound_decoder_, *packet, clock_.now_ns());
        (void)avcodec_send_packet(sound_decoder_.get(), packet.get());
      }
      av_packet_unref(packet.get());
    }
  }

  /// Turned as it says that it is shown: every player and export of the record shows it so.
  media::Frame as_shown(media::Frame frame) {
    PictureTreatment treatment;
    turn_ = turn_of(*frame, turn_of_stream_, turn_);
    treatment.turn = *turn_;
    treatment.is_turned = can_turn(*frame, treatment.turn);
    treatment.fields = field_order_of(*frame);
    treatment_ = treatment;
    return treatment.is_turned ? turned(*frame, treatment.turn) : std::move(frame);
  }

  /// As av_read_frame(), which a device without a picture answers at once.
  int next_packet(AVPacket& packet) {
    for (;;) {
      const int read = av_read_frame(input_.get(), &packet);
      if (read == AVERROR(EAGAIN)) {
        if (must_stop()) return AVERROR_EXIT;
        std::this_thread::sleep_for(kDeviceInterval);
        continue;
      }
      if (read >= 0 && address_.kind == SourceKind::kDevice) keep(packet);
      return read;
    }
  }

  /// What a device gives lies in memory of its driver, which goes when it is closed; decoded pictures may
  /// still refer to it then.
  void keep(AVPacket& packet) const {
    const media::Packet copy = media::make_packet();
    if (box_ == nullptr || !box_->make_packet(*copy, packet.size))
      require(av_new_packet(copy.get(), packet.size), "take a picture from its driver");
    std::copy_n(packet.data, packet.size, copy->data);
    require(av_packet_copy_props(copy.get(), &packet), "take a picture from its driver");
    av_packet_unref(&packet);
    av_packet_move_ref(&packet, copy.get());
  }

  void rewind() {
    const std::int64_t start = input_->start_time == AV_NOPTS_VALUE ? 0 : input_->start_time;
    require(av_seek_frame(input_.get(), -1, start, AVSEEK_FLAG_BACKWARD),
            "cannot play " + name_ + " again from its start");
    avcodec_flush_buffers(decoder_.get());
    if (sound_decoder_) avcodec_flush_buffers(sound_decoder_.get());
    last_pts_ns_.reset();
  }

  /// The file's own time line, beginning at 0 and always going forward, over loops and jumps.
  std::int64_t file_time_ns(const AVFrame& frame, TimeBreak& broken) {
    const std::int64_t step = 1'000'000'000LL * rate_.denominator / rate_.numerator;
    std::int64_t advance = frames_read_ == 0 ? 0 : step;
    if (frame.best_effort_timestamp != AV_NOPTS_VALUE) {
      const std::int64_t pts_ns =
          av_rescale_q(frame.best_effort_timestamp, input_->streams[stream_]->time_base, kNanoseconds);
      if (last_pts_ns_) {
        std::int64_t difference = 0;
        const bool overflows = __builtin_sub_overflow(pts_ns, *last_pts_ns_, &difference);
        if (overflows || difference > longest_hole_ns()) {
          broken = pts_ns > *last_pts_ns_ ? TimeBreak::kAhead : TimeBreak::kBack;
        } else if (difference <= -kLeastStepBackNs) {
          broken = TimeBreak::kBack;
        } else if (difference > 0) {
          advance = difference;
        }
        // One picture's time stands for what nobody knows.
        if (broken != TimeBreak::kNone) advance = 2 * step;
      }
      last_pts_ns_ = pts_ns;
    }
    ++frames_read_;
    return file_time_ns_ += advance;
  }

  [[nodiscard]] std::int64_t longest_hole_ns() const {
    if (!address_.unpaced()) return kLongestPacedHoleNs;
    return std::max(kLongestPacedHoleNs, std::min(kLongestHoleNs, kLongestFilmNs - file_time_ns_));
  }

  /// How many pictures the source's own times leave out before this one, where data were damaged on the way
  /// (a transport stream counts its packets, and a decoder misses what it refers to). Without damage a hole
  /// is the source's own: there was nothing to send.
  std::uint64_t lost_on_the_way_before(const AVFrame& frame) {
    if (frame.decode_error_flags != 0 || (frame.flags & AV_FRAME_FLAG_CORRUPT) != 0)
      damage_concerns_ = kPicturesOfDamage;
    if (frame.best_effort_timestamp == AV_NOPTS_VALUE) return 0;
    const std::int64_t pts_ns =
        av_rescale_q(frame.best_effort_timestamp, input_->streams[stream_]->time_base, kNanoseconds);
    const std::int64_t advance = pts_ns - last_pts_ns_.value_or(pts_ns);
    last_pts_ns_ = pts_ns;
    if (damage_concerns_ == 0) return 0;
    --damage_concerns_;
    const std::int64_t step = 1'000'000'000LL * rate_.denominator / rate_.numerator;
    if (advance < step || advance > kLongestLossNs) return 0;
    return static_cast<std::uint64_t>((advance + step / 2) / step - 1);
  }

  /// On the same time line as the pictures; negative where there is no picture to go by.
  [[nodiscard]] std::int64_t sound_time_ns(const AVFrame& frame) const {
    if (live_) return last_time_ns_ < 0 ? -1 : std::min(media::number_of(frame), clock_.now_ns());
    if (!last_pts_ns_ || frame.best_effort_timestamp == AV_NOPTS_VALUE) return -1;
    const std::int64_t pts_ns =
        av_rescale_q(frame.best_effort_timestamp, input_->streams[sound_stream_]->time_base, kNanoseconds);
    std::int64_t difference = 0;
    const bool overflows = __builtin_sub_overflow(pts_ns, *last_pts_ns_, &difference);
    // Sound of beyond a break: where the pictures before it go on, nothing is known yet.
    if (overflows || difference > longest_hole_ns() || difference < -kLongestPacedHoleNs) return -1;
    return file_time_ns_ + difference;
  }

  const SourceAddress address_;
  const CaseClock& clock_;
  const std::atomic<bool>* cancelled_;  // while opening
  Pulse* const pulse_;                  // may be null
  const std::int64_t silence_ns_;       // a live source that sends nothing for so long is lost
  const std::string name_;
  const BoxHooks* const box_;  // null: it works in no box
  const std::string told_;     // by whoever opens it
  const bool live_;
  const bool wants_sound_;
  const bool loop_;
  bool opening_ = true;
  std::int64_t deadline_ns_ = 0;
  std::vector<std::string> locations_;  // what libavformat is given, one after the other
  std::unique_ptr<FifoInput> fifo_;
  std::unique_ptr<FileInput> file_;
  media::InputContext input_;
  media::Codec decoder_;
  int stream_ = -1;
  media::Codec sound_decoder_;
  int sound_stream_ = -1;
  PictureFormat format_;
  Rational rate_;
  std::string transport_;  // of RTSP
  std::string remark_;
  Turn turn_of_stream_ = Turn::kNone;
  std::optional<Turn> turn_;  // of the newest picture
  PictureTreatment treatment_, treatment_at_opening_;
  media::Frame first_frame_;
  std::int64_t last_time_ns_ = -1;
  std::optional<std::int64_t> last_pts_ns_;
  int damage_concerns_ = 0;  // so many of the next pictures may be missing for damage that was seen
  std::int64_t file_time_ns_ = 0;
  std::uint64_t frames_read_ = 0;
};

}  // namespace

std::unique_ptr<Source> open_ffmpeg_source(const SourceAddress& address, const CaseClock& clock,
                                           const OpeningTerms& terms) {
  media::silence_libav();
  return std::make_unique<FfmpegSource>(address, clock, terms);
}

}  // namespace kiroku::recorder
