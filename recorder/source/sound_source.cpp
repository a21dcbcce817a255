#include "recorder/source/sound_source.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavdevice/avdevice.h>
#include <libavformat/avformat.h>
#include <libavutil/time.h>
}

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <mutex>
#include <thread>

#include "base/error.h"
#include "media/libav_versions.h"

namespace kiroku::recorder {
namespace {

using media::require;

// libavdevice keeps its descriptor to itself, so a device is asked this often whether it has sound.
constexpr std::chrono::milliseconds kDeviceInterval{5};
constexpr int kUsualRate = 48'000, kLeastRate = 8'000, kMostRate = 192'000;
constexpr int kUsualChannels = 1, kMostChannels = 8;
// What ALSA keeps for a reader is far less.
constexpr std::int64_t kOldestNs = 2'000'000'000;
// libavdevice tells times by the wall clock. One that was set is seen by as much.
constexpr std::int64_t kLargestStepUs = 20'000;
// No crystal is wrong by as much. What is faster has no clock at all: ALSA's "null" and "file" give as much
// as is asked for.
constexpr double kFastest = 1.01;

class SoundSource : public Source {
 public:
  SoundSource(const SourceAddress& address, const CaseClock& clock, const OpeningTerms& terms)
      : clock_(clock),
        cancelled_(terms.cancelled),
        pulse_(terms.pulse),
        silence_ns_(terms.silence.count()),
        name_("sound '" + address.stated + "'") {
    const SoundFormat asked = sound_format_asked(address);
    open_input(address.location, asked.sample_rate, asked.channels);
    open_decoder();
    cancelled_ = nullptr;
  }

  [[nodiscard]] PictureFormat format() const override { return {}; }
  [[nodiscard]] Rational frame_rate() const override { return {}; }
  [[nodiscard]] std::optional<SoundFormat> sound_format() const override {
    return SoundFormat{decoder_->sample_rate, decoder_->ch_layout.nb_channels, decoder_->sample_fmt};
  }
  [[nodiscard]] bool is_live() const override { return true; }
  [[nodiscard]] std::string input() const override {
    return std::to_string(decoder_->sample_rate) + " Hz, " + std::to_string(decoder_->ch_layout.nb_channels) +
           (decoder_->ch_layout.nb_channels == 1 ? " channel" : " channels");
  }

  std::optional<TimedFrame> read() override {
    media::Frame frame = media::make_frame();
    while (!interrupted()) {
      const int received = avcodec_receive_frame(decoder_.get(), frame.get());
      if (received == 0) {
        TimedFrame timed;
        timed.is_sound = true;
        timed.time_ns = last_ns_ = std::max(media::number_of(*frame), last_ns_);
        timed.frame = std::move(frame);
        return timed;
      }
      if (received != AVERROR(EAGAIN)) require(received, "cannot read " + name_);
      const media::Packet packet = media::make_packet();
      if (!next_packet(*packet)) return {};
      media::set_number(*decoder_, *packet, taken_at_ns(*packet));
      require(avcodec_send_packet(decoder_.get(), packet.get()), "cannot read " + name_);
    }
    return {};
  }

 private:
  static int must_stop(void* self) {
    const auto* source = static_cast<SoundSource*>(self);
    return source->interrupted() || (source->cancelled_ != nullptr && *source->cancelled_) ? 1 : 0;
  }

  void open_input(const std::string& pcm, int rate, int channels) {
    static std::once_flag registered;
    std::call_once(registered, avdevice_register_all);
    const AVInputFormat* const alsa = av_find_input_format("alsa");
    if (alsa == nullptr) throw Error(name_ + " cannot be opened: this libavdevice has no ALSA");
    media::Options options;
    options.set("sample_rate", std::to_string(rate));
    options.set("channels", std::to_string(channels));
    AVFormatContext* raw = avformat_alloc_context();
    if (raw == nullptr) throw std::bad_alloc();
    raw->interrupt_callback = {must_stop, this};
    raw->flags |= AVFMT_FLAG_NONBLOCK;
    const int opened = avformat_open_input(&raw, pcm.c_str(), alsa, options.address());
    if (opened < 0) {
      throw Error(name_ + " cannot be opened: " + media::libav_error_text(opened) +
                  "; 'arecord -L' lists what there is, and another program may hold it");
    }
    input_.reset(raw);
    if (input_->nb_streams != 1) throw Error(name_ + " cannot be opened: it gives no sound");
  }

  void open_decoder() {
    const AVCodecParameters& parameters = *input_->streams[0]->codecpar;
    const AVCodec* const decoder = avcodec_find_decoder(parameters.codec_id);
    if (decoder == nullptr)
      throw Error(name_ + " cannot be opened: this libavcodec does not know its samples");
    decoder_.reset(avcodec_alloc_context3(decoder));
    if (!decoder_) throw std::bad_alloc();
    const std::string action = "cannot decode " + name_;
    require(avcodec_parameters_to_context(decoder_.get(), &parameters), action);
    decoder_->pkt_timebase = input_->streams[0]->time_base;
    media::carry_numbers(*decoder_);
    require(avcodec_open2(decoder_.get(), decoder, nullptr), action);
  }

  /// False where it was interrupted.
  bool next_packet(AVPacket& packet) {
    const std::int64_t deadline_ns = clock_.now_ns() + silence_ns_;
    while (!interrupted()) {
      if (pulse_ != nullptr) ++*pulse_;
      const bool too_fast =
          first_ns_ && double(samples_) > kFastest * decoder_->sample_rate * seconds_since(*first_ns_);
      const int read = too_fast ? AVERROR(EAGAIN) : av_read_frame(input_.get(), &packet);
      if (read == AVERROR(EAGAIN)) {
        if (clock_.now_ns() > deadline_ns) throw Error(name_ + " gives nothing; check its plug");
        std::this_thread::sleep_for(kDeviceInterval);
        continue;
      }
      if (read < 0) throw Error(name_ + " is lost: " + media::libav_error_text(read));
      return true;
    }
    return false;
  }

  [[nodiscard]] double seconds_since(std::int64_t then_ns) const {
    return static_cast<double>(clock_.now_ns() - then_ns) / 1e9;
  }

  /// When the first sample of a packet was taken. libavdevice states that by the wall clock, smoothed over
  /// the packets: how old it is now holds on any clock, unless the wall clock was set.
  std::int64_t taken_at_ns(const AVPacket& packet) {
    const std::int64_t wall_us = av_gettime();
    const std::int64_t now_ns = clock_.now_ns();
    const std::int64_t ahead_us = wall_us - now_ns / 1000;
    if (wall_ahead_us_ && std::abs(ahead_us - *wall_ahead_us_) > kLargestStepUs) {
      throw Error(name_ + " is opened anew, since the wall clock was set");
    }
    wall_ahead_us_ = ahead_us;
    const int bytes_a_sample =
        av_get_bytes_per_sample(decoder_->sample_fmt) * decoder_->ch_layout.nb_channels;
    const std::int64_t samples = packet.size / std::max(1, bytes_a_sample);
    samples_ += samples;
    if (!first_ns_) first_ns_ = now_ns;
    const std::int64_t age_ns = packet.pts == AV_NOPTS_VALUE ? -1 : (wall_us - packet.pts) * 1000;
    const bool believed = age_ns >= 0 && age_ns <= kOldestNs;
    return now_ns - (believed ? age_ns : samples * 1'000'000'000 / decoder_->sample_rate);
  }

  const CaseClock& clock_;
  const std::atomic<bool>* cancelled_;  // while opening
  Pulse* const pulse_;                  // may be null
  const std::int64_t silence_ns_;
  const std::string name_;
  media::InputContext input_;
  media::Codec decoder_;
  std::optional<std::int64_t> first_ns_;                             // when the first packet came
  std::int64_t samples_ = 0;                                         // that came
  std::int64_t last_ns_ = std::numeric_limits<std::int64_t>::min();  // of the piece that was given last
  std::optional<std::int64_t> wall_ahead_us_;  // of the case clock, when the last packet came
};

}  // namespace

SoundFormat sound_format_asked(const SourceAddress& address) {
  address.require_options("rate,channels");
  return {integer_option(address, "rate", kUsualRate, kLeastRate, kMostRate),
          integer_option(address, "channels", kUsualChannels, 1, kMostChannels), AV_SAMPLE_FMT_S16};
}

std::unique_ptr<Source> open_sound_source(const SourceAddress& address, const CaseClock& clock,
                                          const OpeningTerms& terms) {
  media::silence_libav();
  return std::make_unique<SoundSource>(address, clock, terms);
}

}  // namespace kiroku::recorder
