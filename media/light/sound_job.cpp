#include "media/light/sound_job.h"

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavfilter/avfilter.h>
#include <libavfilter/buffersink.h>
#include <libavfilter/buffersrc.h>
#include <libavformat/avformat.h>
#include <libavutil/channel_layout.h>
#include <libavutil/frame.h>
#include <libavutil/samplefmt.h>
}

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "light/sound_finder.h"
#include "media/light/box_answers.h"
#include "media/segment_input.h"
#include "media/stream_clock.h"

namespace kiroku::media {
namespace {

using light::SoundFinder;

// A code that begins at a window's border is looked for in both.
constexpr int kBorder = SoundFinder::kRate / 4;
constexpr int kLeastRate = SoundFinder::kRate;
// As the recorder takes them.
constexpr int kMostRate = 768'000, kMostChannels = 64;

/// Samples as the finder takes them, from a border before the first window to the end of the last code that
/// begins in the last one.
class SoundRow {
 public:
  explicit SoundRow(int windows)
      : samples_(static_cast<std::size_t>(windows * SoundFinder::kPeriodSamples + 2 * kBorder +
                                          SoundFinder::kCodeSamples + SoundFinder::kSlotSamples)),
        is_there_(samples_.size()) {}

  void put(std::int64_t at, std::span<const std::int16_t> samples) {
    at += kBorder;
    for (const std::int16_t sample : samples) {
      if (at >= 0 && at < static_cast<std::int64_t>(samples_.size())) {
        samples_[static_cast<std::size_t>(at)] = sample;
        is_there_[static_cast<std::size_t>(at)] = true;
      }
      ++at;
    }
  }
  [[nodiscard]] light::SoundStretch window(int number) const {
    const int from = number * SoundFinder::kPeriodSamples;
    return {std::int64_t{from} - kBorder,
            std::span(samples_).subspan(
                static_cast<std::size_t>(from),
                static_cast<std::size_t>(SoundFinder::kPeriodSamples + 2 * kBorder +
                                         SoundFinder::kCodeSamples + SoundFinder::kSlotSamples))};
  }
  [[nodiscard]] bool is_empty(int number) const {
    const auto from = is_there_.begin() + number * SoundFinder::kPeriodSamples;
    return std::count(from, from + SoundFinder::kPeriodSamples + SoundFinder::kCodeSamples, true) <
           SoundFinder::kCodeSamples;
  }
  /// Whether every code that begins in it is recorded. A hundredth may be missing: blocks at cuts.
  [[nodiscard]] bool is_whole(int number) const {
    const auto from = is_there_.begin() + number * SoundFinder::kPeriodSamples + kBorder;
    constexpr int kLength = SoundFinder::kPeriodSamples + SoundFinder::kCodeSamples;
    return std::count(from, from + kLength, true) >= kLength - kLength / 100;
  }

 private:
  std::vector<std::int16_t> samples_;
  std::vector<bool> is_there_;
};

/// Decoded sound as one channel at the finder's rate.
class Converter {
 public:
  explicit Converter(const AVFrame& like)
      : rate_(like.sample_rate),
        format_(like.format),
        channels_(like.ch_layout.nb_channels),
        graph_(avfilter_graph_alloc()) {
    if (!graph_) throw std::bad_alloc();
    graph_->nb_threads = 1;
    const std::string input = "time_base=1/" + std::to_string(rate_) +
                              ":sample_rate=" + std::to_string(rate_) +
                              ":sample_fmt=" + av_get_sample_fmt_name(static_cast<AVSampleFormat>(format_)) +
                              ":channel_layout=" + std::to_string(channels_) + "c";
    const std::string form =
        "sample_fmts=s16:channel_layouts=mono:sample_rates=" + std::to_string(SoundFinder::kRate);
    AVFilterContext* to_form = nullptr;
    make(&source_, "abuffer", input);
    make(&to_form, "aformat", form);  // libavfilter puts a resampler before it
    make(&sink_, "abuffersink", "");
    require(avfilter_link(source_, 0, to_form, 0), kAction);
    require(avfilter_link(to_form, 0, sink_, 0), kAction);
    require(avfilter_graph_config(graph_.get(), nullptr), kAction);
  }
  [[nodiscard]] bool takes(const AVFrame& frame) const {
    return frame.sample_rate == rate_ && frame.format == format_ && frame.ch_layout.nb_channels == channels_;
  }
  /// Null: no more comes.
  void put(AVFrame* frame) {
    if (frame != nullptr) {
      av_channel_layout_uninit(&frame->ch_layout);
      av_channel_layout_default(&frame->ch_layout, channels_);
    }
    require(av_buffersrc_add_frame(source_, frame), kAction);
  }
  bool take(AVFrame& frame) {
    av_frame_unref(&frame);
    const int result = av_buffersink_get_frame(sink_, &frame);
    if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return false;
    require(result, kAction);
    return true;
  }

 private:
  static constexpr const char* kAction = "cannot listen to sound";
  void make(AVFilterContext** filter, const char* kind, const std::string& options) {
    require(avfilter_graph_create_filter(filter, avfilter_get_by_name(kind), kind, options.c_str(), nullptr,
                                         graph_.get()),
            kAction);
  }

  int rate_, format_, channels_;
  FilterGraph graph_;
  AVFilterContext *source_ = nullptr, *sink_ = nullptr;
};

/// Puts the sound of one segment into the row.
class SegmentSound {
 public:
  /// Sound that is stamped before `earliest` or after `latest`, since `from`, is of another time.
  SegmentSound(SegmentInput& input, AVStream& stream, std::string name, Ticks from, Ticks earliest,
               Ticks latest, bool wraps, SoundRow& row)
      : input_(input),
        stream_(stream),
        name_(std::move(name)),
        from_(from),
        earliest_(earliest),
        latest_(latest),
        wraps_(wraps),
        row_(row) {
    const AVCodec* const decoder = avcodec_find_decoder(stream.codecpar->codec_id);
    if (decoder == nullptr)
      throw MediaError("the sound of " + name_ + " is of a kind that this libavcodec cannot decode");
    codec_.reset(avcodec_alloc_context3(decoder));
    if (!codec_) throw std::bad_alloc();
    check(avcodec_parameters_to_context(codec_.get(), stream.codecpar));
    codec_->pkt_timebase = stream.time_base;
    codec_->thread_count = 1;
    check(avcodec_open2(codec_.get(), decoder, nullptr));
  }

  void read() {
    const Packet packet = make_packet();
    try {
      while (input_.read(*packet)) {
        if (packet->stream_index == stream_.index) {
          check(avcodec_send_packet(codec_.get(), packet.get()));
          take_decoded();
        }
        av_packet_unref(packet.get());
      }
      check(avcodec_send_packet(codec_.get(), nullptr));
      take_decoded();
      end_run();
    } catch (const MediaError&) {
      end_damaged_run();
      throw;
    }
  }

 private:
  void take_decoded() {
    const Frame frame = make_frame();
    for (;;) {
      const int result = avcodec_receive_frame(codec_.get(), frame.get());
      if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return;
      check(result);
      if (frame->sample_rate < kLeastRate || frame->nb_samples <= 0) continue;
      if (frame->sample_rate > kMostRate || frame->ch_layout.nb_channels < 1 ||
          frame->ch_layout.nb_channels > kMostChannels ||
          av_get_sample_fmt_name(static_cast<AVSampleFormat>(frame->format)) == nullptr)
        throw MediaError("the sound of " + name_ +
                         " cannot be decoded: it is of a form that no recorder makes");
      if (frame->pts != AV_NOPTS_VALUE) {
        // What the media and the ledger state may be anything.
        const Ticks stamp = bounded(av_rescale_q(frame->pts, stream_.time_base, {1, kTicksPerSecond}));
        const Ticks since = bounded(stamp - from_);
        const Ticks when = wraps_ ? unwrapped(since) : since;
        if (when < earliest_ || when > latest_)
          throw MediaError("the sound of " + name_ +
                           " is stamped outside the time that the ledger states of it");
        const std::int64_t at = av_rescale(when, SoundFinder::kRate, kTicksPerSecond);
        // Containers state times to a millisecond; what is further away is no more of the same run.
        constexpr std::int64_t kApart = SoundFinder::kRate / 50;
        if (!converter_ || !converter_->takes(*frame) || std::abs(at - expected_) > kApart) {
          end_run();
          converting([&] { converter_.emplace(*frame); });
          next_ = expected_ = at;
        }
      } else if (!converter_ || !converter_->takes(*frame)) {
        continue;  // nobody says when that was
      }
      expected_ += av_rescale(frame->nb_samples, SoundFinder::kRate, frame->sample_rate);
      converting([&] { converter_->put(frame.get()); });
      take_converted();
    }
  }
  void end_run() {
    if (!converter_) return;
    converting([&] { converter_->put(nullptr); });
    take_converted();
    converter_.reset();
  }
  /// What came before the damage was heard, as far as the converter still gives it.
  void end_damaged_run() {
    try {
      end_run();
    } catch (const MediaError&) {
      // the damage that is being told already is enough
    }
    converter_.reset();
  }
  void take_converted() {
    const Frame piece = make_frame();
    const auto take = [&] {
      bool is_there = false;
      converting([&] { is_there = converter_->take(*piece); });
      return is_there;
    };
    while (take()) {
      const auto count = static_cast<std::size_t>(piece->nb_samples);
      row_.put(next_, std::span(reinterpret_cast<const std::int16_t*>(piece->data[0]), count));
      next_ += piece->nb_samples;
    }
  }
  static Ticks bounded(Ticks stamp) { return std::clamp(stamp, -kFurthestStamp, kFurthestStamp); }
  /// Sound that libavfilter does not take is damage of its segment alone.
  template <typename Use>
  void converting(const Use& use) const {
    try {
      use();
    } catch (const Error& error) {
      throw MediaError("the sound of " + name_ + " cannot be decoded: " + error.what());
    }
  }
  void check(int result) const {
    if (result < 0)
      throw MediaError("the sound of " + name_ + " cannot be decoded: " + libav_error_text(result));
  }

  SegmentInput& input_;
  AVStream& stream_;
  const std::string name_;
  const Ticks from_, earliest_, latest_;
  const bool wraps_;
  SoundRow& row_;
  Codec codec_;
  std::optional<Converter> converter_;
  std::int64_t next_ = 0, expected_ = 0;  // samples since the first window began
};

Ticks stamp_of_sample(std::int64_t sample) { return av_rescale(sample, kTicksPerSecond, SoundFinder::kRate); }

void tell(SoundFinder& finder, const SoundRow& row, int window, JobSegments& segments) {
  if (row.is_empty(window)) return;
  std::vector<light::HeardCode> heard =
      finder.read(row.window(window), SoundFinder::kPeriodSamples + 2 * kBorder);
  if (!row.is_whole(window)) {
    std::erase_if(heard, [](const light::HeardCode& code) {
      return code.sighting.opposite < SoundFinder::kClearlyHeard;
    });
    if (heard.empty()) return;
  }
  std::string lines = line_of({stamp_of_sample(std::int64_t{window} * SoundFinder::kPeriodSamples), {}});
  for (const light::HeardCode& code : heard)
    lines += line_of({stamp_of_sample(code.sample), {code.sighting}});
  segments.give(bytes_of(lines));
}

}  // namespace

nlohmann::json read_sound_in_box(const nlohmann::json& with, JobSegments& segments) {
  const int windows = std::clamp(with.at("windows").get<int>(), 0, kMostSoundWindows);
  SoundRow row(windows);
  nlohmann::json rates = nlohmann::json::array(), damaged = nlohmann::json::array();
  std::uint64_t number = 0;
  for (const nlohmann::json& asked : with.at("segments")) {
    const std::string name = asked.at("name"), media = asked.at("media");
    int rate = 0;
    try {
      const std::unique_ptr<crypto::ByteSource> segment = segments.open(number);
      SegmentInput input(*segment, media, name);
      if (AVStream* const stream = input.sound(); stream != nullptr) {
        rate = stream->codecpar->sample_rate;
        if (rate >= kLeastRate)
          SegmentSound(input, *stream, name, asked.at("from").get<Ticks>(), asked.at("earliest").get<Ticks>(),
                       asked.at("latest").get<Ticks>(), media == "video/mp2t", row)
              .read();
      }
    } catch (const MediaError&) {
      if (asked.at("complete").get<bool>()) damaged.push_back(number);
    }
    rates.push_back(rate);
    ++number;
  }
  SoundFinder finder(with.at("phases").get<std::vector<int>>());
  for (int window = 0; window < windows; ++window) tell(finder, row, window, segments);
  return {{"phases", finder.phases()}, {"rates", std::move(rates)}, {"damaged", std::move(damaged)}};
}

}  // namespace kiroku::media
