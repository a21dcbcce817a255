#include "recorder/quality/shown_film.h"

extern "C" {
#include <libavutil/frame.h>
}

#include <algorithm>
#include <fstream>
#include <sstream>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/full_range_film.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/textured_film.h"

namespace kiroku::recorder {
namespace {

using testing::HasSubstr;

class ShownFilmTest : public testing::Test {
 protected:
  std::filesystem::path clip(int width, int height, int pictures) {
    const std::filesystem::path file = folder_ / ("clip" + std::to_string(++clips_) + ".mp4");
    test::write_textured_film(file, width, height, pictures);
    return file;
  }
  ShownFilm show(const std::filesystem::path& of, const Coding& coding, const std::string& name) {
    return write_shown_film(of, {}, coding, folder_ / name, {});
  }
  [[nodiscard]] static bool same_pictures(const std::filesystem::path& one,
                                          const std::filesystem::path& other) {
    Clip a(one, {}), b(other, {});
    if (!(a.format() == b.format()) || a.format().colour_range != b.format().colour_range ||
        a.format().colour_space != b.format().colour_space)
      return false;
    for (;;) {
      const media::Frame x = a.next(), y = b.next();
      if (!x || !y) return !x && !y;
      if (!same_samples(*x, *y) || x->pts / 1'000'000 != y->pts / 1'000'000) return false;
    }
  }
  [[nodiscard]] std::string content(const std::string& name) const {
    std::ostringstream all;
    all << std::ifstream(folder_ / name, std::ios::binary).rdbuf();
    return all.str();
  }

  test::TemporaryFolder folder_;
  int clips_ = 0;
};

TEST_F(ShownFilmTest, OfALosslessCodingIsTheClipItself) {
  const std::filesystem::path of = clip(320, 192, 40);
  const ShownFilm lossless = show(of, {CodingFamily::kLossless, 0}, "lossless.mp4");
  EXPECT_EQ(lossless.pictures, 40U);
  EXPECT_NEAR(lossless.seconds, 1.6, 0.05);
  EXPECT_EQ(lossless.depth, 8);
  EXPECT_TRUE(same_pictures(of, folder_ / "lossless.mp4"));
  show(of, {CodingFamily::kUncompressed, 0}, "uncompressed.mp4");
  EXPECT_TRUE(same_pictures(of, folder_ / "uncompressed.mp4"));
}

TEST_F(ShownFilmTest, ShowsWhatACodingTookAndNoMore) {
  const std::filesystem::path of = clip(320, 192, 40);
  show(of, {CodingFamily::kMpeg2, 500'000}, "mpeg2.mp4");
  EXPECT_FALSE(same_pictures(of, folder_ / "mpeg2.mp4"));
  // What is shown of what was shown is the same again.
  show(folder_ / "mpeg2.mp4", {CodingFamily::kUncompressed, 0}, "again.mp4");
  EXPECT_TRUE(same_pictures(folder_ / "mpeg2.mp4", folder_ / "again.mp4"));
}

TEST_F(ShownFilmTest, OfFullRangeIsAsBrightAndDarkWhateverTheCoding) {
  const std::filesystem::path of = folder_ / "full.mkv";
  test::write_full_range_film(of, 320, 192, 30);
  const auto range_of = [](const std::filesystem::path& file) {
    const media::Frame frame = Clip(file, {}).next();
    int least = 255, most = 0;
    for (int y = 0; y < frame->height; ++y) {
      for (int x = 0; x < frame->width; ++x) {
        const int value = frame->data[0][y * frame->linesize[0] + x];
        least = std::min(least, value);
        most = std::max(most, value);
      }
    }
    return std::pair(least, most);
  };
  const auto [dark, bright] = range_of(of);
  ASSERT_LT(dark, 5);
  ASSERT_GT(bright, 250);
  for (const CodingFamily family :
       {CodingFamily::kLossless, CodingFamily::kMpeg2, CodingFamily::kH264, CodingFamily::kH265}) {
    const std::string name = std::string(coding_word(family)) + ".mp4";
    show(of, {family, has_rate(family) ? 4'000'000 : 0}, name);
    const auto [least, most] = range_of(folder_ / name);
    EXPECT_NEAR(least, dark, 6) << name;
    EXPECT_NEAR(most, bright, 6) << name;
  }
}

TEST_F(ShownFilmTest, TellsNothingOfTheCodingBesideItsPictures) {
  const std::filesystem::path of = clip(320, 192, 40);
  show(of, {CodingFamily::kMpeg2, 4'000'000}, "one.mp4");
  show(of, {CodingFamily::kH264, 4'000'000}, "two.mp4");
  // x264 writes how it was asked into the stream: the same in both.
  const auto options = [this](const std::string& name) {
    const std::string all = content(name);
    const std::size_t at = all.find("options:");
    EXPECT_NE(at, std::string::npos);
    return all.substr(at, all.find('\0', at) - at);
  };
  EXPECT_EQ(options("one.mp4"), options("two.mp4"));
  for (const char* const name : {"one.mp4", "two.mp4"}) {
    EXPECT_THAT(content(name), testing::Not(HasSubstr("mpeg2"))) << name;
    EXPECT_THAT(content(name), testing::Not(HasSubstr(of.filename().string()))) << name;
  }
}

TEST_F(ShownFilmTest, IsMadeAsLargeAsTheOthers) {
  const std::filesystem::path of = clip(320, 192, 40);
  show(of, {CodingFamily::kMpeg2, 500'000}, "small.mp4");
  const std::uint64_t has = std::filesystem::file_size(folder_ / "small.mp4");
  EXPECT_THROW(pad_film(folder_ / "small.mp4", has + kLeastPadding - 1), UsageError);
  pad_film(folder_ / "small.mp4", has + 3'000'000);
  EXPECT_EQ(std::filesystem::file_size(folder_ / "small.mp4"), has + 3'000'000);
  show(of, {CodingFamily::kMpeg2, 500'000}, "unpadded.mp4");
  EXPECT_TRUE(same_pictures(folder_ / "small.mp4", folder_ / "unpadded.mp4")) << "players pass over it";
  EXPECT_THAT(content("small.mp4").substr(has + 4, 4), "free");
}

TEST_F(ShownFilmTest, RefusesInOneSentence) {
  EXPECT_THAT(
      [&] {
        show(clip(320, 192, 10), {CodingFamily::kLossless, 0}, "short.mp4");
      },
      testing::ThrowsMessage<UsageError>(HasSubstr("needs at least 1 s")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "short.mp4"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "short.mp4.part"));
  EXPECT_THROW(show(folder_ / "none.mkv", {CodingFamily::kLossless, 0}, "none.mp4"), UsageError);
}

}  // namespace
}  // namespace kiroku::recorder
