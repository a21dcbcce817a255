#include "recorder/encoder/sound_encoder.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavcodec/packet.h>
#include <libavutil/channel_layout.h>
#include <libavutil/frame.h>
#include <libavutil/samplefmt.h>
}

#include <gtest/gtest.h>

namespace kiroku::recorder {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

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

INSTANTIATE_TEST_SUITE_P(All, SoundEncoderOf, testing::Values(Profile::kMpeg2, Profile::kLossless),
                         [](const auto& tested) {
                           return tested.param == Profile::kMpeg2 ? "LayerTwo" : "Flac";
                         });

}  // namespace
}  // namespace kiroku::recorder
