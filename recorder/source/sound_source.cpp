#include "recorder/source/sound_source.h"

#include <alsa/asoundlib.h>

extern "C" {
#include <libavutil/channel_layout.h>
#include <libavutil/frame.h>
#include <libavutil/samplefmt.h>
}

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <mutex>
#include <string>
#include <utility>

#include "recorder/clock/sound_clock.h"

namespace kiroku::recorder {
namespace {

using media::require;

constexpr int kUsualRate = 48'000, kLeastRate = 8'000, kMostRate = 192'000;
constexpr int kUsualChannels = 1, kMostChannels = 8;
// What the driver keeps for a reader who is late, and how often it is asked to say what it has.
constexpr unsigned kBufferUs = 1'000'000, kPeriodUs = 20'000;
// So often the device is asked; a piece is at least, and at most, so long.
constexpr std::int64_t kAskedEveryNs = 10'000'000;
constexpr int kPiecesASecond = 50, kMostPieces = 5;
// A time stamp of the driver that is older says nothing.
constexpr std::int64_t kOldestNs = 2'000'000'000;
// What has no clock, such as ALSA's "null", gives as much as is asked for.
constexpr std::int64_t kMostAheadNs = 2'000'000'000;

struct ClosePcm {
  void operator()(snd_pcm_t* pcm) const { snd_pcm_close(pcm); }
};
using Pcm = std::unique_ptr<snd_pcm_t, ClosePcm>;

struct FreeHwParams {
  void operator()(snd_pcm_hw_params_t* params) const { snd_pcm_hw_params_free(params); }
};
struct FreeSwParams {
  void operator()(snd_pcm_sw_params_t* params) const { snd_pcm_sw_params_free(params); }
};
struct FreeStatus {
  void operator()(snd_pcm_status_t* status) const { snd_pcm_status_free(status); }
};

template <typename Owner, typename Raw>
Owner allocated(int (*allocate)(Raw**)) {
  Raw* raw = nullptr;
  if (allocate(&raw) < 0) throw std::bad_alloc();
  return Owner(raw);
}

void say_nothing(const char* /*file*/, int /*line*/, const char* /*function*/, int /*error*/,
                 const char* /*format*/, ...) {}

/// alsa-lib would write what it thinks of a name to standard error, beside what is said here.
void silence_alsa() {
  static std::once_flag silenced;
  std::call_once(silenced, [] { snd_lib_error_set_handler(say_nothing); });
}

std::int64_t monotonic_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * 1'000'000'000LL + now.tv_nsec;
}

class SoundSource : public Source {
 public:
  SoundSource(const SourceAddress& address, const CaseClock& clock, const OpeningTerms& terms)
      : clock_(clock),
        pulse_(terms.pulse),
        silence_ns_(terms.silence.count()),
        name_("sound '" + address.stated + "'"),
        format_(sound_format_asked(address)),
        status_(allocated<std::unique_ptr<snd_pcm_status_t, FreeStatus>>(snd_pcm_status_malloc)),
        sound_clock_(format_.sample_rate) {
    silence_alsa();
    snd_pcm_t* raw = nullptr;
    const int opened = snd_pcm_open(&raw, address.location.c_str(), SND_PCM_STREAM_CAPTURE, SND_PCM_NONBLOCK);
    if (opened < 0) {
      throw Error(name_ + " cannot be opened: " + snd_strerror(opened) +
                  (opened == -EBUSY ? "; another program has it" : "; 'kiroku devices' lists what there is"));
    }
    pcm_.reset(raw);
    ask_for_format();
    ask_for_time_stamps();
    frame_interval_ = format_.sample_rate / kPiecesASecond;
  }

  [[nodiscard]] PictureFormat format() const override { return {}; }
  [[nodiscard]] Rational frame_rate() const override { return {}; }
  [[nodiscard]] std::optional<SoundFormat> sound_format() const override { return format_; }
  [[nodiscard]] bool is_live() const override { return true; }
  [[nodiscard]] std::string input() const override {
    return std::to_string(format_.sample_rate) + " Hz, " + std::to_string(format_.channels) +
           (format_.channels == 1 ? " channel" : " channels");
  }

  std::optional<TimedFrame> read() override {
    if (!running_) start();
    while (!interrupted()) {
      if (pulse_ != nullptr) ++*pulse_;
      const snd_pcm_uframes_t ready = look();
      if (ready >= static_cast<snd_pcm_uframes_t>(frame_interval_)) {
        if (auto piece = take(std::min(static_cast<int>(std::min<snd_pcm_uframes_t>(ready, kMostRate)),
                                       kMostPieces * frame_interval_))) {
          return piece;
        }
      } else if (clock_.now_ns() - progress_ns_ > silence_ns_) {
        throw Error(name_ + " gives nothing; check its plug");
      }
      if (!wait_until(clock_, clock_.now_ns() + kAskedEveryNs, interruption(), pulse_)) break;
    }
    return {};
  }

 private:
  void ask_for_format() {
    const auto params =
        allocated<std::unique_ptr<snd_pcm_hw_params_t, FreeHwParams>>(snd_pcm_hw_params_malloc);
    snd_pcm_t* const pcm = pcm_.get();
    offered(snd_pcm_hw_params_any(pcm, params.get()), "no form of sound");
    offered(snd_pcm_hw_params_set_access(pcm, params.get(), SND_PCM_ACCESS_RW_INTERLEAVED),
            "no interleaved samples");
    offered(snd_pcm_hw_params_set_format(pcm, params.get(), SND_PCM_FORMAT_S16), "no samples of 16 bit");
    offered(snd_pcm_hw_params_set_channels(pcm, params.get(), static_cast<unsigned>(format_.channels)),
            "no " + std::to_string(format_.channels) + " channels");
    offered(snd_pcm_hw_params_set_rate(pcm, params.get(), static_cast<unsigned>(format_.sample_rate), 0),
            "no " + std::to_string(format_.sample_rate) + " Hz");
    unsigned buffer = kBufferUs;
    unsigned period = kPeriodUs;
    offered(snd_pcm_hw_params_set_buffer_time_near(pcm, params.get(), &buffer, nullptr), "no buffer");
    offered(snd_pcm_hw_params_set_period_time_near(pcm, params.get(), &period, nullptr), "no period");
    offered(snd_pcm_hw_params(pcm, params.get()), "no such form");
  }
  void offered(int result, const std::string& what) {
    if (result < 0) {
      throw Error(name_ + " offers " + what + " (" + snd_strerror(result) +
                  "); write alsa:plughw:… in the place of alsa:hw:…, which converts");
    }
  }

  void ask_for_time_stamps() {
    const auto params =
        allocated<std::unique_ptr<snd_pcm_sw_params_t, FreeSwParams>>(snd_pcm_sw_params_malloc);
    int result = snd_pcm_sw_params_current(pcm_.get(), params.get());
    if (result >= 0)
      result = snd_pcm_sw_params_set_tstamp_mode(pcm_.get(), params.get(), SND_PCM_TSTAMP_ENABLE);
    if (result >= 0)
      result = snd_pcm_sw_params_set_tstamp_type(pcm_.get(), params.get(), SND_PCM_TSTAMP_TYPE_MONOTONIC);
    if (result >= 0) result = snd_pcm_sw_params(pcm_.get(), params.get());
    if (result < 0) throw Error(name_ + " cannot be opened: " + snd_strerror(result));
  }

  /// From nothing: sample 0 is the next.
  void start() {
    sound_clock_ = SoundClock(format_.sample_rate);
    read_ = taken_ = 0;
    begun_ns_ = clock_.now_ns();
    if (!running_) progress_ns_ = begun_ns_;  // a device that only overruns makes none
    int result = snd_pcm_prepare(pcm_.get());
    if (result >= 0) result = snd_pcm_start(pcm_.get());
    if (result < 0) fail(result);
    running_ = true;
  }
  void start_again() {
    overrun_ = true;
    start();
  }

  [[noreturn]] void fail(int error) {
    if (error == -ENODEV || error == -ENXIO || error == -ENOENT)
      throw SoundDeviceGone(name_ + " is gone: it was unplugged");
    throw Error(name_ + " is lost: " + snd_strerror(error));
  }

  /// How many samples wait to be read. What the device says of its time is taken in.
  snd_pcm_uframes_t look() {
    const int result = snd_pcm_status(pcm_.get(), status_.get());
    // Between the driver's reading of its clock and this one nothing waits but the processor.
    const std::int64_t now_ns = clock_.now_ns();
    const std::int64_t now_monotonic_ns = monotonic_ns();
    if (result < 0) fail(result);
    switch (snd_pcm_status_get_state(status_.get())) {
      case SND_PCM_STATE_RUNNING:
        break;
      case SND_PCM_STATE_DISCONNECTED:
        fail(-ENODEV);
      default:  // an overrun; also after the machine slept
        start_again();
        return 0;
    }
    const snd_pcm_uframes_t ready = snd_pcm_status_get_avail(status_.get());
    const auto waiting = std::max(static_cast<std::int64_t>(snd_pcm_status_get_delay(status_.get())),
                                  static_cast<std::int64_t>(ready));
    const std::int64_t taken = read_ + waiting;
    if (taken > taken_) progress_ns_ = now_ns;
    taken_ = taken;
    // A crystal may be ahead, too: by 3.6 s in ten hours.
    const double most_s =
        static_cast<double>(now_ns - begun_ns_) / 1e9 * (1 + SoundClock::kLargestRateError) +
        static_cast<double>(kMostAheadNs) / 1e9;
    if (static_cast<double>(read_) > most_s * format_.sample_rate)
      throw Error(name_ + " gives more sound than time passes: it has no clock");
    snd_htimestamp_t stamp{};
    snd_pcm_status_get_htstamp(status_.get(), &stamp);
    const std::int64_t age_ns = now_monotonic_ns - (stamp.tv_sec * 1'000'000'000LL + stamp.tv_nsec);
    const bool believed = age_ns >= 0 && age_ns <= kOldestNs;
    if (taken > 0) sound_clock_.observe(taken, now_ns - (believed ? age_ns : 0));
    return ready;
  }

  /// Nothing where there is none after all.
  std::optional<TimedFrame> take(int samples) {
    TimedFrame piece;
    piece.is_sound = true;
    piece.frame = media::make_frame();
    AVFrame& frame = *piece.frame;
    frame.sample_rate = format_.sample_rate;
    frame.format = format_.sample_format;
    frame.nb_samples = samples;
    av_channel_layout_default(&frame.ch_layout, format_.channels);
    require(av_frame_get_buffer(&frame, 0), "take the sound of " + name_);
    const snd_pcm_sframes_t got =
        snd_pcm_readi(pcm_.get(), frame.extended_data[0], static_cast<snd_pcm_uframes_t>(samples));
    if (got == -EPIPE || got == -ESTRPIPE) {
      start_again();
      return {};
    }
    if (got == 0 || got == -EAGAIN) return {};
    if (got < 0) fail(static_cast<int>(got));
    frame.nb_samples = static_cast<int>(got);
    piece.time_ns = std::min(sound_clock_.time_of(read_), clock_.now_ns());
    piece.lost_before = std::exchange(overrun_, false) ? 1 : 0;
    read_ += got;
    return piece;
  }

  const CaseClock& clock_;
  Pulse* const pulse_;  // may be null
  const std::int64_t silence_ns_;
  const std::string name_;
  const SoundFormat format_;
  const std::unique_ptr<snd_pcm_status_t, FreeStatus> status_;
  Pcm pcm_;
  int frame_interval_ = 0;  // the least samples of a piece
  bool running_ = false;
  // Since the device was started:
  SoundClock sound_clock_;
  std::int64_t begun_ns_ = 0;
  std::int64_t read_ = 0;         // samples
  std::int64_t taken_ = 0;        // samples, those that wait to be read included
  std::int64_t progress_ns_ = 0;  // when there were more of them
  bool overrun_ = false;          // before the next piece
};

}  // namespace

SoundFormat sound_format_asked(const SourceAddress& address) {
  address.require_options("rate,channels");
  return {integer_option(address, "rate", kUsualRate, kLeastRate, kMostRate),
          integer_option(address, "channels", kUsualChannels, 1, kMostChannels), AV_SAMPLE_FMT_S16};
}

std::unique_ptr<Source> open_sound_source(const SourceAddress& address, const CaseClock& clock,
                                          const OpeningTerms& terms) {
  return std::make_unique<SoundSource>(address, clock, terms);
}

}  // namespace kiroku::recorder
