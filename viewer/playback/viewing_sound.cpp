#include "viewer/playback/viewing_sound.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/channel_layout.h>
#include <libavutil/frame.h>
}

#include "base/error.h"

namespace kiroku::playback {
namespace {

using media::require;

constexpr const char* kAction = "cannot make the sound of a viewing copy";
constexpr int kFastest = 48'000;
constexpr std::int64_t kBlocksOfAPiece = 25;
constexpr std::int64_t kPieceSeconds = kPieceTicks / kTicksPerSecond;

int reduction_of(const SoundForm& form) {
  int by = (form.rate + kFastest - 1) / kFastest;
  while (form.rate % by != 0) ++by;
  return by;
}

/// Samples; the last block of a piece may be shorter.
std::int64_t block_of(int rate) { return (kPieceSeconds * rate + kBlocksOfAPiece - 1) / kBlocksOfAPiece; }

media::Codec make_encoder(const SoundForm& form) {
  media::silence_libav();
  const AVCodec* const codec = avcodec_find_encoder(AV_CODEC_ID_FLAC);
  if (codec == nullptr) throw Error("this libavcodec cannot encode FLAC; install Debian's FFmpeg libraries");
  media::Codec encoder(avcodec_alloc_context3(codec));
  if (!encoder) throw std::bad_alloc();
  encoder->sample_rate = viewing_rate_of(form);
  encoder->sample_fmt = AV_SAMPLE_FMT_S16;
  encoder->time_base = {1, encoder->sample_rate};
  encoder->frame_size = static_cast<int>(block_of(encoder->sample_rate));
  encoder->thread_count = 1;
  av_channel_layout_default(&encoder->ch_layout, form.channels);
  require(avcodec_open2(encoder.get(), codec, nullptr), kAction);
  return encoder;
}

/// A low pass for every `by`-th sample: a sinc of 33 zero crossings in a Blackman window, without delay.
std::vector<double> low_pass(int by) {
  const int reach = 16 * by;
  std::vector<double> taps;
  double sum = 0;
  for (int at = -reach; at <= reach; ++at) {
    const double x = std::numbers::pi * at / by;
    const double phase = std::numbers::pi * (at + reach) / reach;
    const double window = 0.42 - 0.5 * std::cos(phase) + 0.08 * std::cos(2 * phase);
    taps.push_back(window * (at == 0 ? 1.0 : std::sin(x) / x));
    sum += taps.back();
  }
  for (double& tap : taps) tap /= sum;
  return taps;
}

/// Samples [from, to) of the copy.
std::vector<std::int16_t> samples_of(const SegmentOpener& media, const VideoIndex& index,
                                     const SoundForm& form, std::int64_t from, std::int64_t to) {
  SoundReader reader(media, index, form);
  const int by = reduction_of(form);
  if (by == 1) return reader.read(from, to);
  const std::vector<double> taps = low_pass(by);
  const auto reach = static_cast<std::int64_t>(taps.size() / 2);
  const std::vector<std::int16_t> all = reader.read(from * by - reach, to * by + reach);
  std::vector<std::int16_t> samples;
  for (std::int64_t at = 0; at < to - from; ++at) {
    for (int channel = 0; channel < form.channels; ++channel) {
      double sum = 0;
      for (std::size_t tap = 0; tap < taps.size(); ++tap) {
        const std::size_t sample = static_cast<std::size_t>(at * by) + tap;
        sum += taps[tap] *
               all[sample * static_cast<std::size_t>(form.channels) + static_cast<std::size_t>(channel)];
      }
      samples.push_back(static_cast<std::int16_t>(std::lround(std::clamp(sum, -32'768.0, 32'767.0))));
    }
  }
  return samples;
}

media::Frame frame_of(const AVCodecContext& encoder, std::span<const std::int16_t> samples) {
  media::Frame frame = media::make_frame();
  frame->format = encoder.sample_fmt;
  frame->sample_rate = encoder.sample_rate;
  frame->nb_samples = static_cast<int>(samples.size()) / encoder.ch_layout.nb_channels;
  require(av_channel_layout_copy(&frame->ch_layout, &encoder.ch_layout), kAction);
  require(av_frame_get_buffer(frame.get(), 0), kAction);
  std::ranges::copy(samples, reinterpret_cast<std::int16_t*>(frame->data[0]));
  return frame;
}

}  // namespace

int viewing_rate_of(const SoundForm& form) { return form.rate / reduction_of(form); }

InitSegment make_sound_init_segment(const SoundForm& form) {
  const media::Codec encoder = make_encoder(form);
  return FragmentMuxer(*encoder, 1).init();
}

Bytes make_sound_piece(const SegmentOpener& media, const VideoIndex& index, const SoundForm& form,
                       std::uint64_t number) {
  const int rate = viewing_rate_of(form);
  const Ticks begin = static_cast<Ticks>(number) * kPieceTicks;
  Ticks first = begin + kPieceTicks, last = begin;
  for (std::size_t i = index.first_reaching(begin);
       i < index.segments.size() && index.segments[i].start < begin + kPieceTicks; ++i) {
    first = std::min(first, std::max(index.segments[i].start, begin));
    last = std::min(index.segments[i].end, begin + kPieceTicks);
  }
  if (first >= last) return {};
  const std::int64_t block = block_of(rate);
  const std::int64_t piece = static_cast<std::int64_t>(number) * kPieceSeconds * rate;
  const auto sample_of = [&](Ticks time) { return (time - begin) * rate / kTicksPerSecond; };
  const std::int64_t from = piece + sample_of(first) / block * block;
  const std::int64_t to =
      piece + std::min((sample_of(last) + block - 1) / block * block, kPieceSeconds * rate);
  const std::vector<std::int16_t> samples = samples_of(media, index, form, from, to);

  const media::Codec encoder = make_encoder(form);
  FragmentMuxer muxer(*encoder, static_cast<std::uint32_t>(number + 1));
  for (std::int64_t at = from; at < to; at += block) {
    const std::int64_t length = std::min(block, to - at);
    const media::Frame frame =
        frame_of(*encoder, std::span(samples).subspan(static_cast<std::size_t>((at - from) * form.channels),
                                                      static_cast<std::size_t>(length * form.channels)));
    frame->pts = at;
    require(avcodec_send_frame(encoder.get(), frame.get()), kAction);
    const media::Packet packet = media::make_packet();
    require(avcodec_receive_packet(encoder.get(), packet.get()), kAction);
    packet->pts = packet->dts = at;
    packet->duration = length;
    muxer.write(*packet);
  }
  return muxer.fragment();
}

}  // namespace kiroku::playback
