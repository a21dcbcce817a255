#include "viewer/playback/viewing_pictures.h"

extern "C" {
#include <libavutil/frame.h>
}

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "media/libav_versions.h"

namespace kiroku::playback {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

constexpr ViewingFormat kFormat{.width = 64, .height = 48, .matrix = 6};

/// All grey.
ArchivedPicture picture(int width, int height, Ticks time, int pixel_format = AV_PIX_FMT_YUV420P) {
  ArchivedPicture made;
  made.frame = media::make_frame();
  made.frame->width = width;
  made.frame->height = height;
  made.frame->format = pixel_format;
  media::require(av_frame_get_buffer(made.frame.get(), 0), "cannot make a picture");
  constexpr int kGrey = 128;
  for (int plane = 0; plane < 3 && made.frame->data[plane] != nullptr; ++plane) {
    const int lines = plane == 0 ? height : (height + 1) / 2;
    std::fill_n(made.frame->data[plane], lines * made.frame->linesize[plane], std::uint8_t{kGrey});
  }
  made.time = made.frame->pts = time;
  return made;
}

int luma(const AVFrame& frame, int x, int y) { return frame.data[0][y * frame.linesize[0] + x]; }

std::vector<Ticks> times(const std::vector<ArchivedPicture>& pictures) {
  std::vector<Ticks> found;
  for (const ArchivedPicture& one : pictures) found.push_back(one.time);
  return found;
}

TEST(ViewingPictures, LeavesAPictureOfTheRightFormAlone) {
  ViewingPictures viewing(kFormat);
  const ArchivedPicture given = picture(64, 48, 7);
  ArchivedPicture same = picture(64, 48, 7);
  same.frame = media::reference(*given.frame);
  const auto ready = viewing.add(std::move(same));
  ASSERT_THAT(ready, SizeIs(1));
  EXPECT_EQ(ready[0].frame->data[0], given.frame->data[0]);
  EXPECT_THAT(viewing.finish(), IsEmpty());
}

TEST(ViewingPictures, OddSidesBecomeEven) {
  const ArchivedPicture odd = picture(97, 65, 0, AV_PIX_FMT_GRAY8);
  const ViewingFormat format = viewing_format_of(*odd.frame, 3600);
  EXPECT_EQ(format.width, 98);
  EXPECT_EQ(format.height, 66);
  EXPECT_EQ(format.rate, 25);
  ViewingPictures viewing(format);
  const auto ready = viewing.add(picture(97, 65, 0, AV_PIX_FMT_GRAY8));
  ASSERT_THAT(ready, SizeIs(1));
  EXPECT_EQ(ready[0].frame->width, 98);
  EXPECT_EQ(ready[0].frame->format, AV_PIX_FMT_YUV420P);
}

TEST(ViewingPictures, AnotherShapeStandsInBlack) {
  ViewingPictures viewing(kFormat);
  const auto wide = viewing.add(picture(64, 24, 0));
  ASSERT_THAT(wide, SizeIs(1));
  EXPECT_LT(luma(*wide[0].frame, 32, 2), 20);
  EXPECT_NEAR(luma(*wide[0].frame, 32, 24), 128, 2);
  EXPECT_LT(luma(*wide[0].frame, 32, 45), 20);
  const auto narrow = viewing.add(picture(24, 48, 1));
  ASSERT_THAT(narrow, SizeIs(1));
  EXPECT_LT(luma(*narrow[0].frame, 2, 24), 20);
  EXPECT_NEAR(luma(*narrow[0].frame, 32, 24), 128, 2);
}

TEST(ViewingPictures, WeavesFieldsWithoutLosingAPictureOrItsTime) {
  ViewingPictures viewing(kFormat);
  std::vector<ArchivedPicture> all;
  const auto keep = [&](std::vector<ArchivedPicture> ready) {
    for (ArchivedPicture& one : ready) all.push_back(std::move(one));
  };
  for (const Ticks time : {100, 3701, 7300, 10901}) {
    ArchivedPicture fields = picture(64, 48, time);
    media::set_interlaced(*fields.frame, true);
    fields.frame->top_field_first = 1;
    // A comb, as movement between the two fields makes it, other from picture to picture.
    const auto shade = static_cast<std::uint8_t>(time % 2 == 0 ? 255 : 0);
    for (int y = 1; y < 48; y += 2) {
      std::fill_n(fields.frame->data[0] + y * fields.frame->linesize[0], 64, shade);
    }
    keep(viewing.add(std::move(fields)));
  }
  keep(viewing.add(picture(64, 24, 14500)));  // another size: what waited comes first
  keep(viewing.finish());
  ASSERT_THAT(times(all), ElementsAre(100, 3701, 7300, 10901, 14500));
  const AVFrame& woven = *all[1].frame;
  EXPECT_LT(std::abs(luma(woven, 32, 24) - luma(woven, 32, 25)), 30) << "the comb is gone";
}

TEST(ViewingPictures, OnePictureOfFieldsAloneComesOut) {
  ViewingPictures viewing(kFormat);
  ArchivedPicture fields = picture(64, 48, 5);
  media::set_interlaced(*fields.frame, true);
  auto ready = viewing.add(std::move(fields));
  for (ArchivedPicture& one : viewing.finish()) ready.push_back(std::move(one));
  EXPECT_THAT(times(ready), ElementsAre(5));
}

}  // namespace
}  // namespace kiroku::playback
