#include "recorder/encoder/video_encoder.h"

extern "C" {
#include <libavcodec/packet.h>
#include <libavutil/frame.h>
#include <libavutil/pixfmt.h>
}

#include <cstring>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/decoded_video.h"

namespace kiroku::recorder {
namespace {

using test::decode_video;
using testing::Each;
using testing::IsEmpty;
using testing::SizeIs;

constexpr PictureFormat kSmall{64, 48, AV_PIX_FMT_YUV420P, {1, 1}};

media::Frame grey(const PictureFormat& format, int level) {
  media::Frame frame = media::make_frame();
  frame->width = format.width;
  frame->height = format.height;
  frame->format = format.pixel_format;
  frame->color_range = static_cast<AVColorRange>(format.colour_range);
  media::require(av_frame_get_buffer(frame.get(), 0), "cannot make a picture");
  for (int plane = 0; plane < 3 && frame->data[plane] != nullptr; ++plane) {
    const int height = plane == 0 ? format.height : format.height / 2;
    std::memset(frame->data[plane], plane == 0 ? level : 128,
                static_cast<std::size_t>(frame->linesize[plane] * height));
  }
  return frame;
}

VideoProfile profile(Profile kind) {
  VideoProfile wanted;
  wanted.profile = kind;
  return wanted;
}

std::vector<std::int64_t> time_stamps(Rational rate, const std::vector<std::int64_t>& times_ns) {
  VideoEncoder encoder(kSmall, rate, profile(Profile::kMpeg2));
  std::vector<std::int64_t> stamps;
  for (const std::int64_t time_ns : times_ns) {
    const media::Packet packet = encoder.encode(encoder.prepare(grey(kSmall, 100), time_ns), stamps.empty());
    stamps.push_back(packet->pts);
    EXPECT_EQ(packet->dts, packet->pts);
  }
  return stamps;
}

TEST(VideoEncoder, GivesOnePacketForEachPictureAtOnceWithItsTime) {
  EXPECT_THAT(time_stamps({25, 1}, {0, 40'000'000, 80'000'000}), testing::ElementsAre(0, 3600, 7200));
}

TEST(VideoEncoder, DoesNotDriftWhenTheSourceIsFasterThanItSays) {
  std::vector<std::int64_t> times;
  for (int i = 0; i < 600; ++i) times.push_back(i * 33'000'000LL);  // 30.3 pictures a second, not 25
  const auto stamps = time_stamps({25, 1}, times);
  EXPECT_EQ(stamps.back(), 599 * 2970);
}

TEST(VideoEncoder, SpreadsABurstAndThenCatchesUp) {
  // Four pictures arrive together, the next in its time.
  const auto stamps = time_stamps({25, 1}, {0, 1'000'000, 1'000'001, 1'000'002, 200'000'000});
  EXPECT_THAT(stamps, testing::ElementsAre(0, 1800, 3600, 5400, 18000));
}

TEST(VideoEncoder, KeepsItsPicturesNearTheirTimesWhateverTheStatedRate) {
  std::vector<std::int64_t> times;
  for (int i = 0; i < 50; ++i) times.push_back(i * 40'000'000LL);
  const auto stamps = time_stamps({1, 10}, times);  // one in ten seconds, and 25 a second come
  EXPECT_LE(stamps.back(), (49 * 40 + 1000) * 90);
}

TEST(VideoEncoder, CodesOddRatesAtTheNextHigherOneAndKeepsTheTimes) {
  EXPECT_THAT(time_stamps({22, 1}, {0, 45'454'545, 90'909'091}), testing::ElementsAre(0, 4091, 8182));
  EXPECT_THAT(time_stamps({1000, 1}, {0, 40'000'000}), testing::ElementsAre(0, 3600));
}

TEST(VideoEncoder, RefusesAPictureThatIsTooLargeBeforeAnythingIsRecorded) {
  EXPECT_THROW(VideoEncoder({4096, 64, AV_PIX_FMT_YUV420P, {1, 1}}, {25, 1}, profile(Profile::kMpeg2)),
               UsageError);
  EXPECT_NO_THROW(VideoEncoder({4096, 64, AV_PIX_FMT_YUV420P, {1, 1}}, {25, 1}, profile(Profile::kLossless)));
}

TEST(VideoEncoder, RefusesABitRateOutOfBounds) {
  VideoProfile wanted;
  wanted.bit_rate = 99'999;
  EXPECT_THROW(VideoEncoder(kSmall, {25, 1}, wanted), UsageError);
}

/// One segment with one picture, decoded again.
test::DecodedFrame through(const PictureFormat& format, const VideoProfile& wanted, int level) {
  VideoEncoder encoder(format, {25, 1}, wanted);
  const auto muxer = wanted.in_transport_stream() ? make_transport_stream_muxer() : make_matroska_muxer();
  Bytes file;
  muxer->begin({encoder.muxed_stream()}, [&](ByteView bytes) { append(file, bytes); });
  muxer->write(encoder.encode(encoder.prepare(grey(format, level), 0), true), 0);
  muxer->end();
  const auto video = decode_video(file);
  EXPECT_THAT(video.frames, SizeIs(1));
  EXPECT_THAT(video.complaints, IsEmpty());
  return video.frames.at(0);
}

TEST(VideoEncoder, BringsFullRangeIntoTheRangeThatMpeg2PlayersExpect) {
  PictureFormat full = kSmall;
  full.colour_range = AVCOL_RANGE_JPEG;
  EXPECT_NEAR(through(full, profile(Profile::kMpeg2), 255).brightness, 235, 2);
  EXPECT_NEAR(through(kSmall, profile(Profile::kMpeg2), 200).brightness, 200, 2);
  EXPECT_EQ(through(full, profile(Profile::kLossless), 255).brightness, 255);
}

TEST(VideoEncoder, CodesFourTwoTwoWhereAsked) {
  VideoProfile wanted;
  wanted.chroma_422 = true;
  EXPECT_EQ(through(kSmall, wanted, 100).pixel_format, "yuv422p");
  EXPECT_EQ(through(kSmall, profile(Profile::kMpeg2), 100).pixel_format, "yuv420p");
}

TEST(VideoEncoder, KeepsTheSourcesPixelFormatUncompressed) {
  PictureFormat packed = kSmall;
  packed.pixel_format = AV_PIX_FMT_UYVY422;
  EXPECT_EQ(through(packed, profile(Profile::kUncompressed), 100).pixel_format, "uyvy422");
}

TEST(VideoEncoder, CodesPicturesOfAnySizeWithoutLoss) {
  for (const auto& [width, height] : std::vector<std::pair<int, int>>{
           {2, 2}, {16, 300}, {64, 48}, {352, 288}, {354, 288}, {400, 50}, {480, 360}, {720, 576}}) {
    const PictureFormat format{width, height, AV_PIX_FMT_YUV420P, {1, 1}};
    SCOPED_TRACE(format.to_string());
    const test::DecodedFrame decoded = through(format, profile(Profile::kLossless), 100);
    EXPECT_EQ(decoded.width, width);
    EXPECT_EQ(decoded.brightness, 100);
  }
}

TEST(SegmentMuxer, PassesTheErrorOfItsSinkOn) {
  for (const bool transport : {true, false}) {
    VideoEncoder encoder(kSmall, {25, 1}, profile(transport ? Profile::kMpeg2 : Profile::kUncompressed));
    const auto muxer = transport ? make_transport_stream_muxer() : make_matroska_muxer();
    EXPECT_THROW(
        {
          muxer->begin({encoder.muxed_stream()}, [](ByteView) { throw IoError("write", "segment", ENOSPC); });
          for (int i = 0; i < 100; ++i) {
            muxer->write(encoder.encode(encoder.prepare(grey(kSmall, i), i * 40'000'000LL), true), 0);
          }
          muxer->end();
        },
        IoError);
  }
}

}  // namespace
}  // namespace kiroku::recorder
