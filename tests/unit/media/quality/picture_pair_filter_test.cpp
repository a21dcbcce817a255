#include "media/quality/picture_pair_filter.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/pixfmt.h>
}

#include "media/quality/plane.h"

namespace kiroku::media {
namespace {

/// A picture of 4:2:0 whose luma is `luma` everywhere, plus a coarse pattern.
Frame picture(int luma, int pattern) {
  Frame frame = make_frame();
  frame->width = 64;
  frame->height = 48;
  frame->format = AV_PIX_FMT_YUV420P;
  require(av_frame_get_buffer(frame.get(), 0), "make a picture");
  for (int plane = 0; plane < 3; ++plane) {
    const int shift = plane == 0 ? 0 : 1;
    for (int y = 0; y < 48 >> shift; ++y) {
      for (int x = 0; x < 64 >> shift; ++x)
        frame->data[plane][y * frame->linesize[plane] + x] =
            static_cast<std::uint8_t>(luma + (((x >> 2) + (y >> 2)) % 2 == 0 ? pattern : -pattern));
    }
  }
  return frame;
}

TEST(PicturePairFilter, MeasuresKnownErrors) {
  const Frame original = picture(100, 20), one_more = picture(101, 20), four_more = picture(104, 20);
  PicturePairFilter filter(*original);
  const PairMeasures same = filter.measure(*original, *original);
  EXPECT_EQ(same.mean_square_error, 0);
  EXPECT_NEAR(same.ssim, 1, 1e-6);
  EXPECT_NEAR(filter.measure(*one_more, *original).mean_square_error, 1, 1e-6);
  EXPECT_NEAR(filter.measure(*four_more, *original).mean_square_error, 16, 1e-5);
  // What comes later is measured as what came first.
  EXPECT_EQ(filter.measure(*original, *original).mean_square_error, 0);
  EXPECT_LT(filter.measure(*picture(100, 2), *original).ssim, 0.6);
}

TEST(PicturePairFilter, StatesDecibels) {
  EXPECT_FALSE(psnr_of(0, 8));
  EXPECT_NEAR(*psnr_of(1, 8), 48.1308, 1e-4);
  EXPECT_NEAR(*psnr_of(1, 10), 60.1975, 1e-4);
}

TEST(Plane, TakesLumaInStepsOfEightBits) {
  const Frame shallow = picture(100, 20);
  const Plane luma = luma_of(*shallow);
  EXPECT_EQ(luma.width, 64);
  EXPECT_EQ(luma.at(0, 0), 120);
  EXPECT_EQ(luma.at(4, 0), 80);
  Frame deep = make_frame();
  deep->width = 16;
  deep->height = 16;
  deep->format = AV_PIX_FMT_YUV420P10;
  require(av_frame_get_buffer(deep.get(), 0), "make a picture");
  for (int y = 0; y < 16; ++y) {
    auto* const row = reinterpret_cast<std::uint16_t*>(deep->data[0] + std::ptrdiff_t{y} * deep->linesize[0]);
    for (int x = 0; x < 16; ++x) row[x] = 402;
  }
  EXPECT_EQ(luma_of(*deep).at(3, 3), 100.5F);
  deep->format = AV_PIX_FMT_RGBA;
  EXPECT_THROW(luma_of(*deep), Error);
}

}  // namespace
}  // namespace kiroku::media
