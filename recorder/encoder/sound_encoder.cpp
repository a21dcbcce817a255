#include "recorder/encoder/sound_encoder.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavfilter/avfilter.h>
#include <libavfilter/buffersink.h>
#include <libavfilter/buffersrc.h>
#include <libavutil/channel_layout.h>
#include <libavutil/samplefmt.h>
}

#include <algorithm>
#include <string>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

using media::require;

constexpr const char* kAction = "cannot encode sound";
constexpr int kLayer2Rate = 48'000;
constexpr std::int64_t kLayer2BitsPerChannel = 96'000;
// Of what is longer the recorder would make silence for as long as it takes, and hold it in memory.
constexpr std::int64_t kLongestFilledNs = 10'000'000'000;
// By so much at most sound is made faster or slower: ten times what a crystal is wrong by, and a sixtieth of
// a semitone.
constexpr int kMostResampled = 1'000;  // one of so many samples

std::string layout_of(int channels) { return std::to_string(channels) + "c"; }

/// What an `abuffer` is told of the frames to come.
std::string input_of(const std::string& time_base, int rate, AVSampleFormat format, int channels) {
  return "time_base=" + time_base + ":sample_rate=" + std::to_string(rate) +
         ":sample_fmt=" + av_get_sample_fmt_name(format) + ":channel_layout=" + layout_of(channels);
}

}  // namespace

SoundEncoder::SoundEncoder(const SoundFormat& format, const VideoProfile& profile, Pace pace) : pace_(pace) {
  const bool layer2 = profile.in_transport_stream();
  const AVCodec* codec = avcodec_find_encoder(layer2 ? AV_CODEC_ID_MP2 : AV_CODEC_ID_FLAC);
  if (codec == nullptr) throw Error("this libavcodec cannot encode sound; install Debian's FFmpeg libraries");
  codec_.reset(avcodec_alloc_context3(codec));
  if (!codec_) throw std::bad_alloc();
  const int channels = std::clamp(format.channels, 1, 2);
  av_channel_layout_default(&codec_->ch_layout, channels);
  codec_->sample_rate = layer2 ? kLayer2Rate : format.sample_rate;
  const auto source = static_cast<AVSampleFormat>(format.sample_format);
  const bool deep = source == AV_SAMPLE_FMT_S32 || source == AV_SAMPLE_FMT_S32P;
  codec_->sample_fmt = deep && !layer2 ? AV_SAMPLE_FMT_S32 : AV_SAMPLE_FMT_S16;
  if (layer2) codec_->bit_rate = kLayer2BitsPerChannel * channels;
  codec_->time_base = {1, codec_->sample_rate};
  require(avcodec_open2(codec_.get(), codec, nullptr), kAction);
}

MuxedStream SoundEncoder::muxed_stream() const { return {codec_.get(), {1, codec_->sample_rate}}; }

SoundEncoder::Filter SoundEncoder::make_filter(const std::string& input, const std::string& description) {
  Filter filter;
  filter.graph.reset(avfilter_graph_alloc());
  if (!filter.graph) throw std::bad_alloc();
  AVFilterGraph* const graph = filter.graph.get();
  graph->nb_threads = 1;
  require(avfilter_graph_create_filter(&filter.source, avfilter_get_by_name("abuffer"), "in", input.c_str(),
                                       nullptr, graph),
          kAction);
  require(avfilter_graph_create_filter(&filter.sink, avfilter_get_by_name("abuffersink"), "out", nullptr,
                                       nullptr, graph),
          kAction);
  AVFilterInOut* inputs = nullptr;
  AVFilterInOut* outputs = nullptr;
  int result = avfilter_graph_parse2(graph, description.c_str(), &inputs, &outputs);
  if (result >= 0) {
    result = avfilter_link(filter.source, 0, inputs->filter_ctx, static_cast<unsigned>(inputs->pad_idx));
  }
  if (result >= 0) {
    result = avfilter_link(outputs->filter_ctx, static_cast<unsigned>(outputs->pad_idx), filter.sink, 0);
  }
  avfilter_inout_free(&inputs);
  avfilter_inout_free(&outputs);
  require(result, kAction);
  require(avfilter_graph_config(graph, nullptr), kAction);
  return filter;
}

SoundEncoder::Filter SoundEncoder::make_converter(const AVFrame& sound) const {
  // Samples are dropped or silence is filled in where the time stamps say so by more than a tenth of a second
  // (FFmpeg's "async", man ffmpeg-resampler). Above 1, "async" is by how many samples a second it may stretch
  // or squeeze besides; the resampler must be there from the start then, since one that begins in the middle
  // forgets its times.
  const std::string async =
      pace_ == Pace::kAsTheyCome ? "1" : std::to_string(sound.sample_rate / kMostResampled) + ":flags=res";
  return make_filter(input_of("1/1000000000", sound.sample_rate, static_cast<AVSampleFormat>(sound.format),
                              sound.ch_layout.nb_channels),
                     "aresample=" + std::to_string(codec_->sample_rate) + ":async=" + async +
                         ",aformat=sample_fmts=" + av_get_sample_fmt_name(codec_->sample_fmt) +
                         ":channel_layouts=" + layout_of(codec_->ch_layout.nb_channels));
}

SoundEncoder::Filter SoundEncoder::make_divider() const {
  return make_filter(input_of("1/" + std::to_string(codec_->sample_rate), codec_->sample_rate,
                              codec_->sample_fmt, codec_->ch_layout.nb_channels),
                     "asetnsamples=n=" + std::to_string(codec_->frame_size) + ":p=0");
}

std::vector<media::Packet> SoundEncoder::encode(media::Frame sound, std::int64_t time_ns) {
  std::vector<media::Packet> packets;
  const bool after_long = time_ns - converted_until_ns_ > kLongestFilledNs;
  if (!converter_.graph || after_long || !(converted_format_ == sound_format_of(*sound))) {
    end_converter(packets);
    converter_ = make_converter(*sound);
    converted_format_ = sound_format_of(*sound);
  }
  converted_until_ns_ = time_ns + sound->nb_samples * 1'000'000'000LL / sound->sample_rate;
  // Layouts are named by their number of channels, whatever the source calls them.
  av_channel_layout_uninit(&sound->ch_layout);
  av_channel_layout_default(&sound->ch_layout, converted_format_.channels);
  sound->pts = time_ns;
  require(av_buffersrc_add_frame(converter_.source, sound.get()), kAction);
  take_from_converter(packets);
  return packets;
}

void SoundEncoder::end_converter(std::vector<media::Packet>& packets) {
  if (!converter_.graph) return;
  require(av_buffersrc_close(converter_.source, AV_NOPTS_VALUE, 0), kAction);
  take_from_converter(packets);
  converter_ = {};
}

std::vector<media::Packet> SoundEncoder::drain() {
  std::vector<media::Packet> packets;
  end_converter(packets);
  if (!divider_.graph) return packets;
  require(av_buffersrc_close(divider_.source, AV_NOPTS_VALUE, 0), kAction);
  take_from_divider(packets);
  take_from_encoder(nullptr, packets);
  return packets;
}

void SoundEncoder::take_from_converter(std::vector<media::Packet>& packets) {
  for (;;) {
    media::Frame piece = media::make_frame();
    const int result = av_buffersink_get_frame(converter_.sink, piece.get());
    if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return;
    require(result, kAction);
    const std::int64_t place =
        av_rescale_q(piece->pts, av_buffersink_get_time_base(converter_.sink), codec_->time_base);
    if (!next_sample_) next_sample_ = next_block_ = place;
    // A converter fills the holes in what it was given, and drops what overlaps, but not between another and
    // itself.
    const std::int64_t hole = place - *next_sample_;
    if (hole < -codec_->sample_rate / 10) continue;
    if (hole > kLongestFilledNs / 1'000'000'000 * codec_->sample_rate) {
      pass_over(hole, packets);
    } else if (hole > codec_->sample_rate / 10) {
      add_silence(hole, packets);
    }
    divide(piece.get(), packets);
  }
}

void SoundEncoder::add_silence(std::int64_t samples, std::vector<media::Packet>& packets) {
  while (samples > 0) {
    media::Frame silence = media::make_frame();
    silence->format = codec_->sample_fmt;
    silence->sample_rate = codec_->sample_rate;
    silence->nb_samples = static_cast<int>(std::min<std::int64_t>(samples, codec_->frame_size));
    require(av_channel_layout_copy(&silence->ch_layout, &codec_->ch_layout), kAction);
    require(av_frame_get_buffer(silence.get(), 0), kAction);
    require(av_samples_set_silence(silence->extended_data, 0, silence->nb_samples,
                                   silence->ch_layout.nb_channels, codec_->sample_fmt),
            kAction);
    samples -= silence->nb_samples;
    divide(silence.get(), packets);
  }
}

void SoundEncoder::pass_over(std::int64_t samples, std::vector<media::Packet>& packets) {
  const std::int64_t block = codec_->frame_size;
  const std::int64_t begun = (*next_sample_ - *next_block_) % block;
  const std::int64_t rest = begun == 0 ? 0 : block - begun;
  add_silence(rest, packets);
  const std::int64_t left_out = (samples - rest) / block * block;
  *next_sample_ += left_out;
  *next_block_ += left_out;
  add_silence(samples - rest - left_out, packets);
}

void SoundEncoder::divide(AVFrame* sound, std::vector<media::Packet>& packets) {
  if (!divider_.graph) divider_ = make_divider();
  sound->pts = *next_sample_;
  *next_sample_ += sound->nb_samples;
  require(av_buffersrc_add_frame(divider_.source, sound), kAction);
  take_from_divider(packets);
}

void SoundEncoder::take_from_divider(std::vector<media::Packet>& packets) {
  for (;;) {
    media::Frame block = media::make_frame();
    const int result = av_buffersink_get_frame(divider_.sink, block.get());
    if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return;
    require(result, kAction);
    block->pts = *next_block_;
    *next_block_ += block->nb_samples;
    take_from_encoder(block.get(), packets);
  }
}

void SoundEncoder::take_from_encoder(const AVFrame* sound, std::vector<media::Packet>& packets) {
  require(avcodec_send_frame(codec_.get(), sound), kAction);
  for (;;) {
    media::Packet packet = media::make_packet();
    const int result = avcodec_receive_packet(codec_.get(), packet.get());
    if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return;
    require(result, kAction);
    packets.push_back(std::move(packet));
  }
}

}  // namespace kiroku::recorder
