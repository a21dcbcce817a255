#include "recorder/encoder/sound_encoder.h"

#include <cmath>

#include "tests/support/nanoseconds.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavcodec/codec_par.h>
#include <libavcodec/packet.h>
#include <libavutil/channel_layout.h>
#include <libavutil/frame.h>
#include <libavutil/samplefmt.h>
}

#include <gtest/gtest.h>

namespace kiroku::recorder {
namespace {

media::Frame silence(int rate, int channels, AVSampleFormat format, int samples) {
  media::Frame frame = media::make_frame();
  frame->format = format;
  frame->sample_rate = rate;
  frame->nb_samples = samples;
  av_channel_layout_default(&frame->ch_layout, channels);
  media::require(av_frame_get_buffer(frame.get(), 0), "cannot make sound");
  media::require(av_samples_set_silence(frame->extended_data, 0, samples, channels, format),
                 "cannot make sound");
  return frame;
}

class SoundEncoderOf : public testing::TestWithParam<Profile> {
 protected:
  /// A second of sound in frames that fit no block, from `begin_s` on.
  void hear(double begin_s, int rate, int channels, AVSampleFormat format) {
    constexpr int kPieces = 50;
    for (int i = 0; i < kPieces; ++i) {
      const double at = begin_s + static_cast<double>(i) / kPieces;
      take(encoder.encode(silence(rate, channels, format, rate / kPieces),
                          static_cast<std::int64_t>(at * static_cast<double>(kSecond))));
    }
  }

  void take(std::vector<media::Packet> made) {
    for (media::Packet& packet : made) {
      if (packet->size > 0) packets.push_back(std::move(packet));  // FLAC's last only tells its digest
    }
  }

  [[nodiscard]] static VideoProfile profile() {
    VideoProfile wanted;
    wanted.profile = GetParam();
    wanted.audio = true;
    return wanted;
  }

  SoundEncoder encoder{{48'000, 2, AV_SAMPLE_FMT_S16}, profile()};
  std::vector<media::Packet> packets;
};

TEST_P(SoundEncoderOf, GoesOnWhenTheSourceSendsAnotherForm) {
  hear(1, 48'000, 2, AV_SAMPLE_FMT_S16);
  hear(2, 44'100, 1, AV_SAMPLE_FMT_FLTP);
  hear(5, 48'000, 2, AV_SAMPLE_FMT_S16);  // two seconds of nothing before it
  take(encoder.drain());

  const AVCodecContext& codec = *encoder.muxed_stream().encoder;
  const std::int64_t block = codec.frame_size;
  ASSERT_GT(packets.size(), 10U);
  for (std::size_t i = 0; i + 1 < packets.size(); ++i) {
    EXPECT_EQ(packets[i + 1]->pts - packets[i]->pts, block) << "block " << i;
  }
  const std::int64_t lead = codec.initial_padding;
  EXPECT_EQ(packets.front()->pts + lead, 48'000);
  const std::int64_t end = packets.back()->pts + block + lead;
  EXPECT_GE(end, 6 * 48'000 - 100);  // a converter keeps some samples that it would need more for
  EXPECT_LE(end, 6 * 48'000 + 2 * block);
}

TEST_P(SoundEncoderOf, LeavesOutHoursOfNothingByWholeBlocks) {
  constexpr std::int64_t kHours = 3;
  hear(1, 48'000, 2, AV_SAMPLE_FMT_S16);
  const std::size_t before = packets.size();
  hear(kHours * 3'600 + 0.01, 48'000, 2, AV_SAMPLE_FMT_S16);
  take(encoder.drain());

  const AVCodecContext& codec = *encoder.muxed_stream().encoder;
  ASSERT_GT(packets.size(), before + 5);
  EXPECT_LT(packets.size(), 2 * before + 10) << "silence was made for it";
  for (const media::Packet& packet : packets)
    EXPECT_EQ((packet->pts - packets.front()->pts) % codec.frame_size, 0) << "another row of blocks";
  const std::int64_t end = packets.back()->pts + codec.frame_size + codec.initial_padding;
  EXPECT_NEAR(static_cast<double>(end), 48'000.0 * (kHours * 3'600 + 1.01), 2.0 * codec.frame_size);
}

TEST_P(SoundEncoderOf, DropsWhatOverlapsWhatWasThere) {
  hear(1, 48'000, 2, AV_SAMPLE_FMT_S16);
  hear(1.5, 44'100, 2, AV_SAMPLE_FMT_S16);
  take(encoder.drain());
  const AVCodecContext& codec = *encoder.muxed_stream().encoder;
  const std::int64_t end = packets.back()->pts + codec.frame_size + codec.initial_padding;
  EXPECT_NEAR(static_cast<double>(end), 48'000 * 2.5, 4'800 + 2.0 * codec.frame_size);
}

/// The sound of a card that is wrong by so much, a beep at each second of its own count; when the encoder
/// says that beeps were, against when they were.
double worst_place_of_beeps(double wrong_by_ppm, int seconds, SoundEncoder::Pace pace) {
  constexpr int kRate = 8'000, kSamples = kRate / 50;
  VideoProfile profile;
  profile.profile = Profile::kLossless;
  profile.audio = true;
  SoundEncoder encoder({kRate, 1, AV_SAMPLE_FMT_S16}, profile, pace);
  const AVCodec* const flac = avcodec_find_decoder(AV_CODEC_ID_FLAC);
  const media::Codec decoder(avcodec_alloc_context3(flac));
  AVCodecParameters* parameters = avcodec_parameters_alloc();
  media::require(avcodec_parameters_from_context(parameters, encoder.muxed_stream().encoder), "");
  media::require(avcodec_parameters_to_context(decoder.get(), parameters), "");
  avcodec_parameters_free(&parameters);
  media::require(avcodec_open2(decoder.get(), nullptr, nullptr), "");
  double worst_ns = 0;
  int beeps = 0;
  bool loud_before = false;
  const media::Frame frame = media::make_frame();
  const double true_rate = kRate * (1 + wrong_by_ppm / 1e6);
  for (std::int64_t sample = 0; sample < std::int64_t{seconds} * kRate; sample += kSamples) {
    media::Frame piece = silence(kRate, 1, AV_SAMPLE_FMT_S16, kSamples);
    for (int i = 0; i < kSamples; ++i) {
      reinterpret_cast<std::int16_t*>(piece->data[0])[i] = (sample + i) % kRate < kRate / 20 ? 8'000 : 0;
    }
    const auto taken_ns = static_cast<std::int64_t>(static_cast<double>(sample) / true_rate * 1e9);
    for (const media::Packet& packet : encoder.encode(std::move(piece), taken_ns)) {
      media::require(avcodec_send_packet(decoder.get(), packet.get()), "");
      while (avcodec_receive_frame(decoder.get(), frame.get()) == 0) {
        for (int i = 0; i < frame->nb_samples; ++i) {
          const bool loud = reinterpret_cast<const std::int16_t*>(frame->data[0])[i] > 4'000;
          if (loud && !loud_before) {
            const double stated_ns = static_cast<double>(packet->pts + i) / kRate * 1e9;
            const double number = std::round(stated_ns / 1e9 * true_rate / kRate);
            worst_ns = std::max(worst_ns, std::abs(stated_ns - number * kRate / true_rate * 1e9));
            ++beeps;
          }
          loud_before = loud;
        }
      }
    }
  }
  EXPECT_GE(beeps, seconds - 2);
  return worst_ns;
}

TEST(SoundEncoder, KeepsTheSoundOfACardThatIsWrongBy100PpmToTheCaseClock) {
  constexpr int kTwentyMinutes = 1'200;  // 0.12 s, were it left as it is
  for (const double ppm : {-100.0, 100.0}) {
    EXPECT_LT(worst_place_of_beeps(ppm, kTwentyMinutes, SoundEncoder::Pace::kResampled), 5e6) << ppm;
  }
}

INSTANTIATE_TEST_SUITE_P(All, SoundEncoderOf, testing::Values(Profile::kMpeg2, Profile::kLossless),
                         [](const auto& tested) {
                           return tested.param == Profile::kMpeg2 ? "LayerTwo" : "Flac";
                         });

}  // namespace
}  // namespace kiroku::recorder
