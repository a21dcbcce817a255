#include "recorder/source/synthetic_scene.h"

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
}

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "recorder/clock/case_clock.h"
#include "recorder/source/scene_layer.h"
#include "recorder/source/scene_text.h"
#include "recorder/source/source.h"

namespace kiroku::recorder {
namespace {

using testing::Each;
using testing::HasSubstr;

constexpr int kBlack = 16, kWhite = 235, kNoColour = 128;

int luma(const AVFrame& picture, int x, int y) { return picture.data[0][y * picture.linesize[0] + x]; }
int chroma(const AVFrame& picture, int plane, int x, int y) {
  return picture.data[plane][y / 2 * picture.linesize[plane] + x / 2];
}
std::vector<int> all_luma(const AVFrame& picture) {
  std::vector<int> all;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) all.push_back(luma(picture, x, y));
  return all;
}
media::Frame black_picture(int width, int height) {
  media::Frame picture = new_picture(width, height);
  SceneLayer({width, height, [](int, int) { return Paint{}; }}).fill(*picture, 0, 0);
  return picture;
}
SceneForm form(int width, int height, AVPixelFormat format = AV_PIX_FMT_YUV420P) {
  return {width, height, 25, format};
}

TEST(SceneLayer, LiesOverWhatShinesThroughIt) {
  const media::Frame picture = black_picture(16, 16);
  const SceneLayer half({4, 4, [](int x, int) { return Paint{255, 255, 255, x < 2 ? 128.0F : 0.0F}; }});
  half.lay_over(*picture, 4, 4);
  EXPECT_EQ(luma(*picture, 4, 4), (kBlack + kWhite) / 2 + 1);  // 128 of 255 is more than half
  EXPECT_EQ(luma(*picture, 6, 4), kBlack);
  EXPECT_EQ(luma(*picture, 3, 4), kBlack);
  EXPECT_EQ(chroma(*picture, 1, 4, 4), kNoColour);
  const SceneLayer red({4, 4, [](int, int) { return Paint{255, 0, 0}; }});
  red.lay_over(*picture, 9, 9);  // made even
  EXPECT_EQ(luma(*picture, 8, 8), 81);
  EXPECT_EQ(chroma(*picture, 1, 8, 8), 90);
  EXPECT_EQ(chroma(*picture, 2, 8, 8), 240);
}

TEST(SceneLayer, LeavesOutWhatIsBeyondTheEdges) {
  const SceneLayer white({8, 8, [](int, int) { return Paint{255, 255, 255}; }});
  for (const auto& [x, y] : {std::pair{-4, -4}, {12, 12}, {-4, 12}, {12, -4}, {-8, 0}, {0, 16}, {200, -90}}) {
    const media::Frame picture = black_picture(16, 16);
    white.lay_over(*picture, x, y);
    for (int row = 0; row < 16; ++row)
      for (int column = 0; column < 16; ++column)
        ASSERT_EQ(luma(*picture, column, row),
                  column >= x && column < x + 8 && row >= y && row < y + 8 ? kWhite : kBlack)
            << x << ' ' << y;
  }
}

TEST(ScenePlane, BlursToMeansAndKeepsTheEdges) {
  ScenePlane plane(5, 4);
  plane.row(1)[2] = 9;
  plane.blur(1);
  EXPECT_FLOAT_EQ(plane.row(0)[1], 1);
  EXPECT_FLOAT_EQ(plane.row(2)[3], 1);
  EXPECT_NEAR(plane.row(3)[2], 0, 1e-5);
  EXPECT_NEAR(plane.row(1)[0], 0, 1e-5);
  ScenePlane even(6, 6);
  for (int y = 0; y < 6; ++y)
    for (float& value : even.row(y)) value = 7;
  even.blur(2);
  for (int y = 0; y < 6; ++y) EXPECT_THAT(even.row(y), Each(testing::FloatEq(7)));
}

TEST(SceneText, IsWrittenInDots) {
  const media::Frame picture = black_picture(64, 32);
  write_text(*picture, 10, 10, 2, "1-", {255, 255, 255});
  // The 1: a stroke in the middle column, from the first row to the last.
  for (int row = 0; row < kTextRows; ++row) EXPECT_EQ(luma(*picture, 10 + 2 * 2, 10 + 2 * row), kWhite);
  EXPECT_EQ(luma(*picture, 10, 10), kBlack);
  // The hyphen: one row.
  EXPECT_EQ(luma(*picture, 22, 16), kWhite);
  EXPECT_EQ(luma(*picture, 22, 18), kBlack);
}

TEST(SceneText, StandsInADarkBoxAndEndsAtThePicturesEdges) {
  const std::string text = "20:50:00 UTC";
  constexpr int kBorder = 8;
  const int width = static_cast<int>(text.size()) * (kTextColumns + 1) - 1;
  for (const auto& [x, y] : {std::pair{-6, -6}, {50, 10}, {0, 28}, {-500, 0}, {63, 31}}) {
    const media::Frame picture = white_picture(form(64, 32));
    write_text(*picture, x, y, 1, text, {255, 255, 0});
    for (int row = 0; row < 32; ++row)
      for (int column = 0; column < 64; ++column) {
        const bool inside = column >= x - kBorder && column < x + width + kBorder && row >= y - kBorder &&
                            row < y + kTextRows + kBorder;
        ASSERT_EQ(luma(*picture, column, row) < kWhite, inside) << x << ' ' << y;
      }
  }
}

TEST(SyntheticScene, AnEndoscopeShowsTissueInARoundField) {
  const auto scene = make_scene("endoscope", form(320, 240));
  const media::Frame first = scene->picture(0), later = scene->picture(25);
  EXPECT_EQ(luma(*first, 0, 0), kBlack);
  EXPECT_EQ(luma(*first, 319, 239), kBlack);
  EXPECT_GT(luma(*first, 160, 90), 60);
  EXPECT_GT(chroma(*first, 2, 160, 90), kNoColour + 15);  // red
  EXPECT_NE(all_luma(*first), all_luma(*later));
  EXPECT_EQ(all_luma(*first), all_luma(*make_scene("endoscope", form(320, 240))->picture(0)));
  EXPECT_EQ(first->color_range, AVCOL_RANGE_MPEG);
  EXPECT_EQ(first->sample_aspect_ratio.num, first->sample_aspect_ratio.den);
}

TEST(SyntheticScene, ARoomShowsHowLongItWent) {
  const auto scene = make_scene("room", form(640, 480));
  const media::Frame first = scene->picture(0), next = scene->picture(1);
  // The last of two digits of the picture's number; its box is where nothing else moves.
  int different = 0;
  for (int y = 60; y < 110; ++y)
    for (int x = 0; x < 160; ++x) different += luma(*first, x, y) != luma(*next, x, y) ? 1 : 0;
  EXPECT_GT(different, 20);
  EXPECT_GT(luma(*first, 330, 60), 150);              // the lamp
  EXPECT_LT(chroma(*first, 2, 320, 300), kNoColour);  // the drape
}

TEST(SyntheticScene, APatternMovesAndComesAgain) {
  const auto scene = make_scene("pattern", form(96, 64));
  EXPECT_NE(all_luma(*scene->picture(0)), all_luma(*scene->picture(1)));
  EXPECT_EQ(all_luma(*scene->picture(3)), all_luma(*scene->picture(67)));
}

TEST(SyntheticScene, PicturesComeInOtherFormats) {
  for (const char* name : {"pattern", "endoscope", "room"})
    for (const AVPixelFormat format :
         {AV_PIX_FMT_GRAY8, AV_PIX_FMT_UYVY422, AV_PIX_FMT_YUV422P10LE, AV_PIX_FMT_RGB24}) {
      const media::Frame picture = make_scene(name, form(64, 48, format))->picture(5);
      EXPECT_EQ(picture->format, format);
      EXPECT_EQ(picture->width, 64);
      EXPECT_EQ(picture->height, 48);
    }
  EXPECT_GT(white_picture(form(64, 48, AV_PIX_FMT_RGB24))->data[0][5], 250);
  EXPECT_THROW(make_scene("pattern", form(64, 48, AV_PIX_FMT_VAAPI)), Error);
  EXPECT_EQ(make_scene("opera", form(64, 48)), nullptr);
}

TEST(SyntheticSource, FlashesAtItsTimeAlone) {
  const CaseClock clock;
  const auto source =
      open_source(parse_source_address("synthetic:endoscope?size=64x48&rate=5&flash=2&speed=max"), clock, {});
  for (int number = 0; number < 21; ++number) {
    const auto timed = source->read();
    ASSERT_TRUE(timed);
    EXPECT_EQ(timed->time_ns, std::int64_t{number} * 200'000'000);
    EXPECT_EQ(luma(*timed->frame, 0, 0), number % 10 == 0 ? kWhite : kBlack) << number;
  }
}

TEST(SyntheticSource, RefusesAFormatThatNothingMakes) {
  const CaseClock clock;
  const auto open = [&](const char* address) {
    try {
      open_source(parse_source_address(address), clock, {});
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(open("synthetic:pattern?size=64x48&pixel_format=vaapi"), HasSubstr("pixel format 'vaapi'"));
  EXPECT_THAT(open("synthetic:opera"), HasSubstr("there is no source 'synthetic:opera'"));
}

}  // namespace
}  // namespace kiroku::recorder
