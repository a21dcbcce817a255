#include "recorder/quality/clip.h"

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/pixfmt.h>
}

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include <gtest/gtest.h>

#include "media/film_writer.h"
#include "media/rgb_converter.h"
#include "tests/support/media_maker.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

/// The first picture of a film of one picture, again and again, as a page would show it.
std::vector<std::uint8_t> seen(const std::filesystem::path& file, const std::vector<std::uint8_t>& samples,
                               int channels, PictureFormat& format) {
  constexpr int kWidth = 64, kHeight = 32;
  media::FilmWriter film(file, {kWidth, kHeight, channels, 25, 1});
  for (int n = 0; n < 25; ++n) film.add({kWidth, kHeight, channels, samples});
  film.finish();
  Clip clip(file, {});
  format = clip.format();
  media::RgbConverter converter;
  return converter.convert(*clip.next());
}

TEST(Clip, OfRgbKeepsItsColours) {
  const test::TemporaryFolder folder;
  std::vector<std::uint8_t> samples;
  for (int i = 0; i < 64 * 32; ++i) {
    samples.push_back(static_cast<std::uint8_t>(i % 64 * 4));
    samples.push_back(static_cast<std::uint8_t>(i / 64 * 8));
    samples.push_back(static_cast<std::uint8_t>(255 - i % 64 * 4));
  }
  PictureFormat format;
  const std::vector<std::uint8_t> found = seen(folder / "rgb.mkv", samples, 3, format);
  EXPECT_EQ(format.pixel_format, AV_PIX_FMT_YUV444P);
  EXPECT_EQ(format.colour_range, AVCOL_RANGE_MPEG);
  EXPECT_EQ(format.colour_space, AVCOL_SPC_BT709) << "a browser would take it for RGB";
  ASSERT_EQ(found.size(), samples.size());
  int worst = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) worst = std::max(worst, std::abs(found[i] - samples[i]));
  EXPECT_LE(worst, 3) << "what eight bits of YCbCr round";
}

TEST(Clip, OfGreyKeepsItsBrightness) {
  const test::TemporaryFolder folder;
  std::vector<std::uint8_t> samples;
  for (int i = 0; i < 64 * 32; ++i) samples.push_back(static_cast<std::uint8_t>(i % 64 * 4));
  PictureFormat format;
  const std::vector<std::uint8_t> found = seen(folder / "grey.mkv", samples, 1, format);
  EXPECT_EQ(format.colour_range, AVCOL_RANGE_MPEG);
  ASSERT_EQ(found.size(), 3 * samples.size());
  int worst = 0;
  for (std::size_t i = 0; i < found.size(); ++i) worst = std::max(worst, std::abs(found[i] - samples[i / 3]));
  EXPECT_LE(worst, 3);
}

// As the recorder archives it (film_times_test.cpp).
TEST(Clip, OfAFilmThatSaysHowItIsShownIsSo) {
  const test::TemporaryFolder folder;
  constexpr std::int32_t kOne = 1 << 16;
  test::write_film_with_matrix(folder / "plain.mov", {kOne, 0, 0, 0, kOne, 0, 0, 0, 1 << 30});
  test::write_film_with_matrix(folder / "turned.mov", {0, kOne, 0, -kOne, 0, 0, 32 << 16, 0, 1 << 30});
  Clip plain(folder / "plain.mov", {}), turned(folder / "turned.mov", {});
  EXPECT_EQ(turned.format().width, 32);
  EXPECT_EQ(turned.format().height, 64);
  const media::Frame as_coded = plain.next(), as_shown = turned.next();
  ASSERT_TRUE(as_coded && as_shown);
  for (const int y : {0, 13, 63}) {
    for (const int x : {0, 7, 31})
      EXPECT_EQ(as_shown->data[0][y * as_shown->linesize[0] + x],
                as_coded->data[0][(31 - x) * as_coded->linesize[0] + y])
          << x << " " << y;
  }
}

}  // namespace
}  // namespace kiroku::recorder
