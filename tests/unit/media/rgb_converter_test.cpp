#include "media/rgb_converter.h"

#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

extern "C" {
#include <libavutil/frame.h>
}

#include "crypto/byte_source.h"
#include "media/film_writer.h"
#include "media/picture_decoder.h"
#include "media/segment_input.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::media {
namespace {

TEST(RgbConverter, ConvertsColoursAsTheyWere) {
  // Bars, written without loss as computed films are; what is recorded losslessly is decoded the same way.
  constexpr int kWidth = 61, kHeight = 40;
  std::vector<std::uint8_t> bars;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const int x = i % kWidth;
    bars.insert(bars.end(), {static_cast<std::uint8_t>(x * 4), static_cast<std::uint8_t>(255 - x * 4),
                             static_cast<std::uint8_t>(x < 30 ? 200 : 20)});
  }
  const test::TemporaryFolder folder;
  FilmWriter film(folder / "bars.mkv", {kWidth, kHeight, 3, 25, 1});
  film.add({kWidth, kHeight, 3, bars});
  film.finish();
  const auto file = crypto::open_file_source(folder / "bars.mkv");
  SegmentInput input(*file, "video/x-matroska", "bars.mkv");
  PictureDecoder pictures(input, "bars.mkv");
  ASSERT_TRUE(pictures.next());
  RgbConverter converter;
  EXPECT_EQ(converter.convert(pictures.frame()), bars);
  EXPECT_EQ(converter.convert(pictures.frame(), 32, 20).size(), 32U * 20U * 3U);
  EXPECT_FALSE(pictures.next());
}

}  // namespace
}  // namespace kiroku::media
