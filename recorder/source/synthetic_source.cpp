#include "recorder/source/synthetic_source.h"

extern "C" {
#include <libavfilter/avfilter.h>
#include <libavfilter/buffersink.h>
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

namespace kiroku::recorder {
namespace {

using media::require;

struct Scene {
  int width = 1280, height = 720, rate = 25;
  std::string pixel_format = "yuv420p";
  int flash_every_s = 0;
  int beep_every_s = 0;
  int change_after_s = 0;
  std::string light;     // a picture that `kiroku display -o` keeps new, shown on a display in the room
  int light_height = 0;  // pixels
};

Scene scene_of(const SourceAddress& address) {
  address.require_options("size,rate,pixel_format,flash,beep,speed,change,light,light_height");
  Scene scene;
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

std::string size_of(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

/// One picture, computed once and repeated for ever: everything costly is in the still; only crops and
/// overlays move.
std::string still(const std::string& width, const std::string& height, int rate,
                  const std::string& expression, const std::string& format) {
  return "nullsrc=s=" + width + "x" + height + ":r=" + std::to_string(rate) + ":d=1,format=" + format + "," +
         expression + ",trim=end_frame=1,loop=loop=-1:size=1,setpts=N";
}

// Tissue: warm reds with folds (sums of sines bent by each other), fine vessels where two waves cross zero,
// mottled by blurred noise.
constexpr const char* kTissue =
    "geq=r='186+30*sin(X/W*17+2.3*sin(Y/H*9))+18*sin(Y/H*23+1.7*sin(X/W*13))-60*lt(abs(sin(X/W*15+3*sin(Y/"
    "H*6))*sin(Y/H*14+2*sin(X/W*5))),0.025)'"
    ":g='88+24*sin(X/W*17+2.3*sin(Y/H*9))+14*sin(Y/H*23+1.7*sin(X/W*13))-50*lt(abs(sin(X/W*15+3*sin(Y/"
    "H*6))*sin(Y/H*14+2*sin(X/W*5))),0.025)'"
    ":b='76+20*sin(X/W*17+2.3*sin(Y/H*9))+10*sin(Y/H*19)',noise=alls=36:all_seed=7,gblur=sigma=2.2";

// What an endoscope's tip sees of its own light: bright in the middle, black outside the round field.
constexpr const char* kVignette =
    "geq=r=0:g=0:b=0:a='255*clip((hypot(X-W/2,Y-H/2)/(H/2)-0.62)*1.1,0,1)+255*gt(hypot(X-W/2,Y-H/"
    "2),H*0.485)'";

// A grasper from the right: a steel shaft with a lit upper edge, and a tapering jaw.
constexpr const char* kGrasper =
    "geq=r='110+120*exp(-pow((Y-H*0.32)/(H*0.12),2))':g='114+120*exp(-pow((Y-H*0.32)/"
    "(H*0.12),2))':b='120+120*exp(-pow((Y-H*0.32)/(H*0.12),2))'"
    ":a='255*if(gt(X,W*0.3),lt(abs(Y-H/2),H*0.42),lt(abs(abs(Y-H/2)-(W*0.3-X)*0.25),H*0.06+H*0.26*X/"
    "(W*0.3)))'";

// Wet tissue reflects the light in small bright spots.
constexpr const char* kGloss =
    "geq=r=255:g=250:b=245:a='230*gt(sin(X/W*37+5*sin(Y/H*11))*sin(Y/H*31+4*sin(X/"
    "W*17)),0.985)',gblur=sigma=1.1";

std::string endoscope(const Scene& s) {
  const std::string w = std::to_string(s.width), h = std::to_string(s.height);
  const std::string larger_w = std::to_string(s.width * 5 / 4 / 2 * 2),
                    larger_h = std::to_string(s.height * 5 / 4 / 2 * 2);
  const std::string grasper_w = std::to_string(s.width / 2 / 2 * 2),
                    grasper_h = std::to_string(std::max(16, s.height / 9 / 2 * 2));
  const std::string r = std::to_string(s.rate);
  return still(larger_w, larger_h, s.rate, kTissue, "gbrp") + ",format=yuv420p,crop=" + w + ":" + h +
         ":x='(iw-ow)/2*(1+0.8*sin(n/" + r + "*0.9))':y='(ih-oh)/2*(1+0.8*sin(n/" + r + "*1.7))'[tissue];" +
         still(w, h, s.rate, kGloss, "gbrap") + ",format=yuva420p[gloss];" +
         still(grasper_w, grasper_h, s.rate, kGrasper, "gbrap") + ",format=yuva420p[grasper];" +
         still(w, h, s.rate, kVignette, "gbrap") + ",format=yuva420p[vignette];" +
         "[tissue][gloss]overlay=x='8*sin(n/" + r + "*1.3)':y='6*sin(n/" + r +
         "*1.7)'[wet];[wet][grasper]overlay=x='W*0.46+W*0.07*sin(n/" + r + "*0.8)':y='H*0.52+H*0.10*sin(n/" +
         r + "*1.1)'[held];[held][vignette]overlay=shortest=1";
}

// Wall and floor, a lamp's glow, a table under a green drape with its shadow.
constexpr const char* kRoom =
    "geq=r='if(lt(Y,H*0.62),150+20*Y/H,96+30*Y/H)+70*exp(-pow(hypot((X-W*0.52)/(W*0.16),(Y-H*0.16)/"
    "(H*0.20)),2))"
    "-(if(lt(Y,H*0.62),150+20*Y/H,96+30*Y/H)-30)*between(X,W*0.30,W*0.74)*between(Y,H*0.56,H*0.74)'"
    ":g='if(lt(Y,H*0.62),166+20*Y/H,104+30*Y/H)+70*exp(-pow(hypot((X-W*0.52)/(W*0.16),(Y-H*0.16)/"
    "(H*0.20)),2))"
    "-(if(lt(Y,H*0.62),166+20*Y/H,104+30*Y/H)-104)*between(X,W*0.30,W*0.74)*between(Y,H*0.56,H*0.74)'"
    ":b='if(lt(Y,H*0.62),170+20*Y/H,108+30*Y/H)+60*exp(-pow(hypot((X-W*0.52)/(W*0.16),(Y-H*0.16)/"
    "(H*0.20)),2))"
    "-(if(lt(Y,H*0.62),170+20*Y/H,108+30*Y/"
    "H)-96)*between(X,W*0.30,W*0.74)*between(Y,H*0.56,H*0.74)',noise=alls=6:all_seed=3";

// A person in scrubs: head and shoulders.
constexpr const char* kPerson =
    "geq=r='if(lt(Y,H*0.30),if(lt(Y,H*0.14),60,205),52)':g='if(lt(Y,H*0.30),if(lt(Y,H*0.14),120,170),112)':b="
    "'if(lt(Y,H*0.30),if(lt(Y,H*0.14),140,150),118)'"
    ":a='255*gt(lt(hypot((X-W/2)/(W*0.24),(Y-H*0.16)/(H*0.15)),1)+lt(hypot((X-W/2)/(W*0.48),(Y-H*0.72)/"
    "(H*0.46)),1),0)',gblur=sigma=1";

std::string room(const Scene& s) {
  const std::string w = std::to_string(s.width), h = std::to_string(s.height), r = std::to_string(s.rate);
  const std::string person_w = std::to_string(std::max(16, s.width / 7 / 2 * 2)),
                    person_h = std::to_string(std::max(16, s.height / 2 / 2 * 2));
  const std::string font = std::to_string(std::max(10, s.height / 14));
  return still(w, h, s.rate, kRoom, "gbrp") + ",format=yuv420p[room];" +
         still(person_w, person_h, s.rate, kPerson, "gbrap") + ",format=yuva420p,split[one][two];" +
         "[room][one]overlay=x='W*0.20+W*0.03*sin(n/" + r + "*0.6)':y='H*0.30+H*0.01*sin(n/" + r +
         "*2.1)'[a];[a][two]overlay=x='W*0.64+W*0.05*sin(n/" + r + "*0.4+1)':y='H*0.28'" +
         ":shortest=1,drawtext=font=Sans:fontsize=" + font +
         ":fontcolor=white:box=1:boxcolor=black@0.7:boxborderw=8:x=w*0.03:y=h*0.04:text='%{gmtime\\:%Y-%m-%d "
         "%H\\\\\\:%M\\\\\\:%S} UTC'" +
         ",drawtext=font=Sans:fontsize=" + font +
         ":fontcolor=yellow:box=1:boxcolor=black@0.7:boxborderw=8:x=w*0.03:y=h*0.15:text='%{eif\\:trunc(n/" +
         r + "/60)\\:d\\:2}\\:%{eif\\:mod(trunc(n/" + r + ")\\,60)\\:d\\:2}.%{eif\\:mod(n\\," + r +
         ")\\:d\\:2}'";
}

std::string pattern(const Scene& s) {
  // Larger than the picture by a strip that it moves in: a crop moves pointers, no pixel.
  const std::string larger = size_of(s.width + 256, s.height);
  return "testsrc2=s=" + larger + ":r=" + std::to_string(s.rate) +
         ":d=1,trim=end_frame=1,format=" + s.pixel_format +
         ",loop=loop=-1:size=1,setpts=N,crop=" + std::to_string(s.width) + ":" + std::to_string(s.height) +
         ":x='2*mod(n*2,128)':y=0";
}

std::string graph_of(const std::string& name, const SourceAddress& address, const Scene& scene) {
  std::string graph;
  if (name == "endoscope") {
    graph = endoscope(scene);
  } else if (name == "room") {
    graph = room(scene);
  } else if (name == "pattern") {
    graph = pattern(scene);
  } else {
    throw UsageError("there is no source '" + address.stated +
                     "'; pictures come from synthetic:endoscope, synthetic:room and synthetic:pattern");
  }
  if (scene.flash_every_s > 0) {
    graph += ",drawbox=x=0:y=0:w=iw:h=ih:color=white:t=fill:enable='lt(mod(n," +
             std::to_string(scene.flash_every_s * scene.rate) + "),1)'";
  }
  return graph + ",format=" + scene.pixel_format;
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
        scene_(scene_of(address)),
        has_sound_(with_sound && scene_.beep_every_s > 0) {
    if (!scene_.light.empty()) display_.emplace(scene_.light, scene_.light_height);
    build();
    first_frame_ = next();
    format_ = format_of(*first_frame_);
  }

  [[nodiscard]] PictureFormat format() const override { return format_; }
  [[nodiscard]] Rational frame_rate() const override { return {scene_.rate, 1}; }
  [[nodiscard]] std::optional<SoundFormat> sound_format() const override {
    if (!has_sound_) return {};
    return SoundFormat{kSoundRate, 1, AV_SAMPLE_FMT_S16};
  }
  [[nodiscard]] bool is_live() const override { return false; }

  std::optional<TimedFrame> read() override {
    if (interrupted()) return {};
    // What sounds until the next picture goes before it.
    const std::int64_t heard = index_ * kSoundRate / scene_.rate;
    if (has_sound_ && heard > next_sample_) {
      TimedFrame sound;
      sound.is_sound = true;
      sound.frame = sound_of(next_sample_, heard, scene_.beep_every_s);
      sound.time_ns = next_sample_ * 1'000'000'000 / kSoundRate;
      next_sample_ = heard;
      return sound;
    }
    TimedFrame timed;
    timed.frame = first_frame_ ? std::move(first_frame_) : next();
    timed.time_ns = time_of(index_);
    if (!address_.unpaced()) {
      // A camera does not wait for a machine that is too slow: what was due more than a second ago is lost.
      while (time_of(index_) + 1'000'000'000 < clock_.now_ns()) {
        timed.frame = next();
        timed.time_ns = time_of(++index_);
        ++timed.lost_before;
        if (interrupted()) return {};
      }
      if (!wait_until(clock_, timed.time_ns, interruption())) return {};
    }
    show_display(*timed.frame);
    ++index_;
    if (scene_.change_after_s > 0 &&
        index_ == static_cast<std::int64_t>(scene_.change_after_s) * scene_.rate) {
      scene_.width = std::max(16, scene_.width / 4 * 2);
      scene_.height = std::max(16, scene_.height / 4 * 2);
      build();
    }
    return timed;
  }

 private:
  [[nodiscard]] std::int64_t time_of(std::int64_t index) const { return index * 1'000'000'000 / scene_.rate; }

  void build() {
    graph_.reset(avfilter_graph_alloc());
    if (!graph_) throw std::bad_alloc();
    graph_->nb_threads = 1;
    const std::string description = graph_of(address_.location, address_, scene_);
    AVFilterInOut* inputs = nullptr;
    AVFilterInOut* outputs = nullptr;
    require(avfilter_graph_create_filter(&sink_, avfilter_get_by_name("buffersink"), "out", nullptr, nullptr,
                                         graph_.get()),
            "cannot make a synthetic picture");
    const int parsed = avfilter_graph_parse2(graph_.get(), description.c_str(), &inputs, &outputs);
    if (parsed >= 0 && outputs != nullptr) {
      const int linked =
          avfilter_link(outputs->filter_ctx, static_cast<unsigned>(outputs->pad_idx), sink_, 0);
      avfilter_inout_free(&inputs);
      avfilter_inout_free(&outputs);
      require(linked, "cannot make a synthetic picture");
    } else {
      avfilter_inout_free(&inputs);
      avfilter_inout_free(&outputs);
      require(parsed, "cannot make source '" + address_.stated +
                          "' (is a font installed, Debian's fonts-dejavu-core?)");
    }
    require(avfilter_graph_config(graph_.get(), nullptr), "cannot make source '" + address_.stated + "'");
  }

  media::Frame next() {
    media::Frame frame = media::make_frame();
    require(av_buffersink_get_frame(sink_, frame.get()),
            "cannot go on with source '" + address_.stated + "'");
    frame->sample_aspect_ratio = {1, 1};
    return frame;
  }

  /// The picture as it is taken: what the display shows then.
  void show_display(AVFrame& frame) {
    if (!display_) return;
    require(av_frame_make_writable(&frame), "cannot go on with source '" + address_.stated + "'");
    display_->draw(frame);
  }

  SourceAddress address_;
  const CaseClock& clock_;
  Scene scene_;
  bool has_sound_;
  std::optional<RoomDisplay> display_;
  media::FilterGraph graph_;
  AVFilterContext* sink_ = nullptr;
  media::Frame first_frame_;
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
