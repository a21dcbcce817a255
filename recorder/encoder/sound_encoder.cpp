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

}  // namespace

SoundEncoder::SoundEncoder(const SoundFormat& format, const VideoProfile& profile) {
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

void SoundEncoder::build_filter(const AVFrame& sound) {
  graph_.reset(avfilter_graph_alloc());
  if (!graph_) throw std::bad_alloc();
  graph_->nb_threads = 1;
  const auto layout_of = [](int channels) { return std::to_string(channels) + "c"; };
  const std::string input =
      "time_base=1/1000000000:sample_rate=" + std::to_string(sound.sample_rate) +
      ":sample_fmt=" + av_get_sample_fmt_name(static_cast<AVSampleFormat>(sound.format)) +
      ":channel_layout=" + layout_of(sound.ch_layout.nb_channels);
  // Samples are dropped or silence is filled in where the time stamps say so (by more than a tenth of a
  // second): sound keeps to the case clock and is left as it is otherwise.
  const std::string description =
      "aresample=" + std::to_string(codec_->sample_rate) +
      ":async=1,aformat=sample_fmts=" + av_get_sample_fmt_name(codec_->sample_fmt) +
      ":channel_layouts=" + layout_of(codec_->ch_layout.nb_channels) +
      ",asetnsamples=n=" + std::to_string(codec_->frame_size) + ":p=0";
  require(avfilter_graph_create_filter(&source_, avfilter_get_by_name("abuffer"), "in", input.c_str(),
                                       nullptr, graph_.get()),
          kAction);
  require(avfilter_graph_create_filter(&sink_, avfilter_get_by_name("abuffersink"), "out", nullptr, nullptr,
                                       graph_.get()),
          kAction);
  AVFilterInOut* inputs = nullptr;
  AVFilterInOut* outputs = nullptr;
  int result = avfilter_graph_parse2(graph_.get(), description.c_str(), &inputs, &outputs);
  if (result >= 0) {
    result = avfilter_link(source_, 0, inputs->filter_ctx, static_cast<unsigned>(inputs->pad_idx));
  }
  if (result >= 0) {
    result = avfilter_link(outputs->filter_ctx, static_cast<unsigned>(outputs->pad_idx), sink_, 0);
  }
  avfilter_inout_free(&inputs);
  avfilter_inout_free(&outputs);
  require(result, kAction);
  require(avfilter_graph_config(graph_.get(), nullptr), kAction);
  filtered_format_ = sound_format_of(sound);
}

std::vector<media::Packet> SoundEncoder::encode(media::Frame sound, std::int64_t time_ns) {
  std::vector<media::Packet> packets;
  if (!graph_ || !(filtered_format_ == sound_format_of(*sound))) {
    if (graph_) {
      require(av_buffersrc_close(source_, AV_NOPTS_VALUE, 0), kAction);
      take_from_filter(packets);
    }
    build_filter(*sound);
  }
  // Layouts are named by their number of channels, whatever the source calls them.
  av_channel_layout_uninit(&sound->ch_layout);
  av_channel_layout_default(&sound->ch_layout, filtered_format_.channels);
  sound->pts = time_ns;
  require(av_buffersrc_add_frame(source_, sound.get()), kAction);
  take_from_filter(packets);
  return packets;
}

std::vector<media::Packet> SoundEncoder::drain() {
  std::vector<media::Packet> packets;
  if (!graph_) return packets;
  require(av_buffersrc_close(source_, AV_NOPTS_VALUE, 0), kAction);
  take_from_filter(packets);
  take_from_encoder(nullptr, packets);
  return packets;
}

void SoundEncoder::take_from_filter(std::vector<media::Packet>& packets) {
  for (;;) {
    media::Frame piece = media::make_frame();
    const int result = av_buffersink_get_frame(sink_, piece.get());
    if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return;
    require(result, kAction);
    const std::int64_t pts = av_rescale_q(piece->pts, av_buffersink_get_time_base(sink_), codec_->time_base);
    piece->pts = std::max(pts, next_pts_);
    next_pts_ = piece->pts + piece->nb_samples;
    take_from_encoder(piece.get(), packets);
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
