#include "recorder/source/synthetic_source.h"

extern "C" {
#include <libavutil/channel_layout.h>
#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
}

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "recorder/source/synthetic_scene.h"

namespace kiroku::recorder {
namespace {

using media::require;

struct SceneOptions {
  int width = 1280, height = 720, rate = 25;
  std::string pixel_format = "yuv420p";
  int flash_every_s = 0;
  int beep_every_s = 0;
  int change_after_s = 0;
  std::string light;     // a picture that `kiroku display -o` keeps new, shown on a display in the room
  int light_height = 0;  // pixels
};

SceneOptions options_of(const SourceAddress& address) {
  address.require_options("size,rate,pixel_format,flash,beep,speed,change,light,light_height");
  SceneOptions scene;
  if (address.options.contains("size")) {
    const std::string size = address.option("size", "");
    int used = 0;
    if (std::sscanf(size.c_str(), "%dx%d%n", &scene.width, &scene.height, &used) != 2 ||
        used != static_cast<int>(size.size()) || scene.width < 16 || scene.height < 16 ||
        scene.width > 16384 || scene.height > 16384 || scene.width % 2 != 0 || scene.height % 2 != 0) {
      throw UsageError("source '" + address.stated +
                       "': size must be WIDTHxHEIGHT, both even and from 16 to 16384");
    }
  }
  scene.rate = integer_option(address, "rate", scene.rate, 1, 240);
  scene.flash_every_s = integer_option(address, "flash", 0, 0, 3600);
  scene.beep_every_s = integer_option(address, "beep", 0, 0, 3600);
  scene.change_after_s = integer_option(address, "change", 0, 0, 3600);
  scene.pixel_format = address.option("pixel_format", scene.pixel_format);
  if (av_get_pix_fmt(scene.pixel_format.c_str()) == AV_PIX_FMT_NONE) {
    throw UsageError("source '" + address.stated + "': '" + scene.pixel_format +
                     "' is no pixel format that FFmpeg knows (ffmpeg -pix_fmts lists them)");
  }
  scene.light = address.option("light", "");
  scene.light_height =
      integer_option(address, "light_height", std::max(22, scene.height / 12), 8, scene.height / 2);
  if (!scene.light.empty() && (address.location != "room" || scene.pixel_format != "yuv420p")) {
    throw UsageError("source '" + address.stated +
                     "': light is shown in synthetic:room alone, in pixel_format yuv420p");
  }
  if (scene.light.empty() && address.options.contains("light_height")) {
    throw UsageError("source '" + address.stated +
                     "': light_height needs light, a .pgm that 'kiroku display -o' writes");
  }
  return scene;
}

constexpr int kSoundRate = 48'000;
constexpr std::int64_t kBeepSamples = kSoundRate / 10;
constexpr int kBeepHz = 1'000;
constexpr double kBeepAmplitude = 16'000;

/// Silence, and a beep from each `every_s`-th second of the case clock on: samples [first, last) of it.
media::Frame sound_of(std::int64_t first, std::int64_t last, std::int64_t every_s) {
  media::Frame frame = media::make_frame();
  frame->format = AV_SAMPLE_FMT_S16;
  frame->sample_rate = kSoundRate;
  frame->nb_samples = static_cast<int>(last - first);
  av_channel_layout_default(&frame->ch_layout, 1);
  require(av_frame_get_buffer(frame.get(), 0), "cannot make synthetic sound");
  auto* const samples = reinterpret_cast<std::int16_t*>(frame->data[0]);
  for (std::int64_t at = first; at < last; ++at) {
    const std::int64_t since = at % (every_s * kSoundRate);
    const double phase = 2 * std::numbers::pi * kBeepHz * static_cast<double>(since) / kSoundRate;
    samples[at - first] =
        since < kBeepSamples ? static_cast<std::int16_t>(kBeepAmplitude * std::sin(phase)) : std::int16_t{0};
  }
  return frame;
}

/// A display in the room: a binary Netpbm picture (.pgm) that another program keeps new.
class RoomDisplay {
 public:
  RoomDisplay(std::string file, int height) : file_(std::move(file)), height_(height) {}

  /// Into a picture of yuv420p. What cannot be read is a dark display.
  void draw(AVFrame& frame) {
    constexpr std::chrono::milliseconds kLooksEach{40};
    const auto now = std::chrono::steady_clock::now();
    if (now - looked_ >= kLooksEach) {
      looked_ = now;
      load();
    }
    constexpr std::uint8_t kDark = 24, kBright = 196;
    const int shown_width = columns_ > 0 ? height_ * columns_ / rows_ : height_ * 18 / 11;
    const int left = frame.width * 4 / 5 / 2 * 2, top = frame.height / 14 / 2 * 2;
    const int right = std::min(left + shown_width, frame.width),
              bottom = std::min(top + height_, frame.height);
    for (int y = top; y < bottom; ++y) {
      std::uint8_t* const row = frame.data[0] + y * frame.linesize[0];
      for (int x = left; x < right; ++x) {
        row[x] = kDark;
        if (columns_ == 0) continue;
        const std::size_t from_row = static_cast<std::size_t>((y - top) * rows_ / height_);
        const std::size_t from = static_cast<std::size_t>((x - left) * columns_ / shown_width);
        constexpr int kMiddle = 128;
        if (samples_[from_row * static_cast<std::size_t>(columns_) + from] >= kMiddle) row[x] = kBright;
      }
    }
    constexpr int kColourless = 128;
    for (const int plane : {1, 2})
      for (int y = top / 2; y < bottom / 2; ++y)
        std::memset(frame.data[plane] + y * frame.linesize[plane] + left / 2, kColourless,
                    static_cast<std::size_t>((right - left) / 2));
  }

 private:
  void load() {
    columns_ = rows_ = 0;
    std::ifstream file(file_, std::ios::binary);
    std::string form;
    int columns = 0, rows = 0, most = 0;
    constexpr int kLargest = 4'096;
    if (!(file >> form >> columns >> rows >> most) || form != "P5" || most != 255 || columns < 1 ||
        rows < 1 || columns > kLargest || rows > kLargest)
      return;
    file.get();
    samples_.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
    // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): bytes of a file
    file.read(reinterpret_cast<char*>(samples_.data()), static_cast<std::streamsize>(samples_.size()));
    if (!file) return;
    columns_ = columns;
    rows_ = rows;
  }

  const std::string file_;
  const int height_;
  int columns_ = 0, rows_ = 0;
  std::vector<std::uint8_t> samples_;
  std::chrono::steady_clock::time_point looked_{};
};

class SyntheticSource : public Source {
 public:
  SyntheticSource(const SourceAddress& address, const CaseClock& clock, bool with_sound)
      : address_(address),
        clock_(clock),
        options_(options_of(address)),
        has_sound_(with_sound && options_.beep_every_s > 0) {
    if (!options_.light.empty()) display_.emplace(options_.light, options_.light_height);
    build();
    format_ = format_of(*picture(0));
  }

  [[nodiscard]] PictureFormat format() const override { return format_; }
  [[nodiscard]] Rational frame_rate() const override { return {options_.rate, 1}; }
  [[nodiscard]] std::optional<SoundFormat> sound_format() const override {
    if (!has_sound_) return {};
    return SoundFormat{kSoundRate, 1, AV_SAMPLE_FMT_S16};
  }
  [[nodiscard]] bool is_live() const override { return false; }

  std::optional<TimedFrame> read() override {
    if (interrupted()) return {};
    // What sounds until the next picture goes before it.
    const std::int64_t heard = index_ * kSoundRate / options_.rate;
    if (has_sound_ && heard > next_sample_) {
      TimedFrame sound;
      sound.is_sound = true;
      sound.frame = sound_of(next_sample_, heard, options_.beep_every_s);
      sound.time_ns = next_sample_ * 1'000'000'000 / kSoundRate;
      next_sample_ = heard;
      return sound;
    }
    TimedFrame timed;
    if (!address_.unpaced()) {
      // A camera does not wait for a machine that is too slow: what was due more than a second ago is lost.
      while (time_of(index_) + 1'000'000'000 < clock_.now_ns()) {
        ++index_;
        ++timed.lost_before;
        if (interrupted()) return {};
      }
    }
    timed.time_ns = time_of(index_);
    timed.frame = picture(index_);
    if (!address_.unpaced() && !wait_until(clock_, timed.time_ns, interruption())) return {};
    show_display(*timed.frame);
    ++index_;
    if (options_.change_after_s > 0 &&
        index_ == static_cast<std::int64_t>(options_.change_after_s) * options_.rate) {
      options_.width = std::max(16, options_.width / 4 * 2);
      options_.height = std::max(16, options_.height / 4 * 2);
      build();
    }
    return timed;
  }

 private:
  [[nodiscard]] std::int64_t time_of(std::int64_t index) const {
    return index * 1'000'000'000 / options_.rate;
  }

  void build() {
    const SceneForm form{options_.width, options_.height, options_.rate,
                         av_get_pix_fmt(options_.pixel_format.c_str())};
    scene_ = make_scene(address_.location, form);
    if (!scene_)
      throw UsageError("there is no source '" + address_.stated +
                       "'; pictures come from synthetic:endoscope, synthetic:room and synthetic:pattern");
    if (options_.flash_every_s > 0) flash_ = white_picture(form);
  }

  media::Frame picture(std::int64_t number) {
    const std::int64_t flash_every = std::int64_t{options_.flash_every_s} * options_.rate;
    return flash_every > 0 && number % flash_every == 0 ? media::reference(*flash_) : scene_->picture(number);
  }

  /// The picture as it is taken: what the display shows then.
  void show_display(AVFrame& frame) {
    if (!display_) return;
    require(av_frame_make_writable(&frame), "cannot go on with source '" + address_.stated + "'");
    display_->draw(frame);
  }

  SourceAddress address_;
  const CaseClock& clock_;
  SceneOptions options_;
  bool has_sound_;
  std::optional<RoomDisplay> display_;
  std::unique_ptr<SyntheticScene> scene_;
  media::Frame flash_;  // null where there is none
  PictureFormat format_;
  std::int64_t index_ = 0;
  std::int64_t next_sample_ = 0;
};

}  // namespace

std::unique_ptr<Source> open_synthetic_source(const SourceAddress& address, const CaseClock& clock,
                                              bool with_sound) {
  media::silence_libav();
  return std::make_unique<SyntheticSource>(address, clock, with_sound);
}

}  // namespace kiroku::recorder
