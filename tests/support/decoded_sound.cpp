#include "tests/support/decoded_sound.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/frame.h>
}

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "media/libav_handles.h"
#include "tests/support/memory_film.h"

namespace kiroku::test {
namespace {

double sample_of(const AVFrame& frame, int at) {
  const int step = av_sample_fmt_is_planar(static_cast<AVSampleFormat>(frame.format)) != 0
                       ? 1
                       : frame.ch_layout.nb_channels;
  const std::uint8_t* const bytes = frame.extended_data[0];
  switch (frame.format) {
    case AV_SAMPLE_FMT_S16:
    case AV_SAMPLE_FMT_S16P:
      return reinterpret_cast<const std::int16_t*>(bytes)[at * step] / 32'768.0;
    case AV_SAMPLE_FMT_S32:
    case AV_SAMPLE_FMT_S32P:
      return reinterpret_cast<const std::int32_t*>(bytes)[at * step] / 2'147'483'648.0;
    case AV_SAMPLE_FMT_FLT:
    case AV_SAMPLE_FMT_FLTP:
      return reinterpret_cast<const float*>(bytes)[at * step];
    default:
      throw std::runtime_error("sound of an unexpected form");
  }
}

}  // namespace

DecodedSound decode_sound(ByteView film, std::int64_t tolerance) {
  media::silence_libav();
  const MemoryFilm input(film);
  const int index =
      media::require(av_find_best_stream(input.get(), AVMEDIA_TYPE_AUDIO, -1, -1, nullptr, 0), "no sound");
  const AVStream& stream = *input->streams[index];
  const bool layer2 = stream.codecpar->codec_id == AV_CODEC_ID_MP2;
  const media::Codec decoder(avcodec_alloc_context3(
      layer2 ? avcodec_find_decoder_by_name("mp2float") : avcodec_find_decoder(stream.codecpar->codec_id)));
  media::require(avcodec_parameters_to_context(decoder.get(), stream.codecpar), "cannot decode");
  decoder->pkt_timebase = stream.time_base;
  media::require(avcodec_open2(decoder.get(), nullptr, nullptr), "cannot decode");
  DecodedSound sound;
  sound.codec = avcodec_get_name(stream.codecpar->codec_id);
  const media::Packet packet = media::make_packet();
  const media::Frame frame = media::make_frame();
  while (av_read_frame(input.get(), packet.get()) >= 0) {
    if (packet->stream_index == index) {
      media::require(avcodec_send_packet(decoder.get(), packet.get()), "cannot decode");
      while (avcodec_receive_frame(decoder.get(), frame.get()) == 0) {
        sound.rate = frame->sample_rate;
        sound.channels = frame->ch_layout.nb_channels;
        const std::int64_t begins = av_rescale_q(frame->pts, stream.time_base, {1, frame->sample_rate});
        if (sound.samples.empty()) sound.start = begins;
        if (std::abs(begins - sound.end()) > tolerance) sound.breaks.push_back(sound.end() - sound.start);
        for (int at = 0; at < frame->nb_samples; ++at) sound.samples.push_back(sample_of(*frame, at));
      }
    }
    av_packet_unref(packet.get());
  }
  return sound;
}

std::vector<std::int64_t> beeps_of(const DecodedSound& sound) {
  double loudest = 0;
  for (const double sample : sound.samples) loudest = std::max(loudest, std::abs(sample));
  std::vector<std::int64_t> beeps;
  std::int64_t last_loud = -sound.rate;
  for (std::int64_t at = 0; at < static_cast<std::int64_t>(sound.samples.size()); ++at) {
    if (std::abs(sound.samples[static_cast<std::size_t>(at)]) < loudest / 5) continue;
    if (at - last_loud > sound.rate / 100) beeps.push_back(sound.start + at);
    last_loud = at;
  }
  return beeps;
}

}  // namespace kiroku::test
