#include "tests/support/film_with_sound.h"

extern "C" {
#include <libavutil/channel_layout.h>
#include <libavutil/frame.h>
}

#include <cmath>
#include <fstream>
#include <numbers>

#include "media/libav_handles.h"
#include "recorder/encoder/segment_muxer.h"
#include "recorder/encoder/sound_encoder.h"
#include "recorder/encoder/video_encoder.h"
#include "recorder/source/source.h"

namespace kiroku::test {

std::filesystem::path make_film_with_sound(const std::filesystem::path& file, int sample_rate) {
  const int piece_samples = sample_rate / 100;  // a hundredth of a second
  const recorder::CaseClock clock;
  recorder::VideoProfile profile;
  profile.profile = recorder::Profile::kLossless;
  const auto pictures = recorder::open_source(
      recorder::parse_source_address("synthetic:pattern?size=64x48&rate=20&speed=max"), clock);
  recorder::VideoEncoder encoder(pictures->format(), pictures->frame_rate(), profile);
  recorder::SoundEncoder sound({sample_rate, 1, AV_SAMPLE_FMT_S16}, profile);
  const auto muxer = recorder::make_matroska_muxer();
  std::ofstream film(file, std::ios::binary);
  muxer->begin({encoder.muxed_stream(), sound.muxed_stream()}, [&](ByteView bytes) {
    film.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  });
  for (int i = 0; i < 200; ++i) {
    const std::int64_t time_ns = i * 10'000'000LL;
    if (i % 5 == 0) {
      media::Frame picture = encoder.prepare(std::move(pictures->read().value().frame), time_ns);
      muxer->write(encoder.encode(std::move(picture), i == 0), 0);
    }
    media::Frame piece = media::make_frame();
    piece->nb_samples = piece_samples;
    piece->format = AV_SAMPLE_FMT_S16;
    piece->sample_rate = sample_rate;
    av_channel_layout_default(&piece->ch_layout, 1);
    media::require(av_frame_get_buffer(piece.get(), 0), "cannot make sound");
    auto* samples = reinterpret_cast<std::int16_t*>(piece->data[0]);
    for (int k = 0; k < piece_samples; ++k) {
      samples[k] = static_cast<std::int16_t>(
          8192 * std::sin(2 * std::numbers::pi * kToneHz * (i * piece_samples + k) / sample_rate));
    }
    for (media::Packet& packet : sound.encode(std::move(piece), time_ns)) muxer->write(std::move(packet), 1);
  }
  for (media::Packet& packet : sound.drain()) muxer->write(std::move(packet), 1);
  muxer->end();
  return file;
}

}  // namespace kiroku::test
