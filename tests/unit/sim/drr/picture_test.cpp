#include "sim/drr/picture.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::sim {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

void write(const std::filesystem::path& file, std::string_view text) {
  std::ofstream(file, std::ios::binary) << text;
}

TEST(DrrPicture, GreyIsTheWindowOfWhatArrives) {
  const ProjectionImage image{4, 1, {0, std::log(5.0F), std::log(15.0F), 20}};
  EXPECT_THAT(picture_of(image, Response::kTransmission, {0, 1}, Polarity::kBoneBlack).values,
              ElementsAre(65535, 13107, 4369, 0));
  EXPECT_THAT(picture_of(image, Response::kTransmission, {0, 1}, Polarity::kBoneWhite).values,
              ElementsAre(0, 52428, 61166, 65535));
  EXPECT_THAT(picture_of(image, Response::kTransmission, {0.1, 0.15}, Polarity::kBoneBlack).values,
              ElementsAre(65535, 65535, 0, 0));
  EXPECT_THAT(picture_of(image, Response::kFilm, {0, 20}, Polarity::kBoneWhite).values,
              ElementsAre(0, 5274, 8874, 65535));
  EXPECT_THROW(static_cast<void>(picture_of(image, Response::kFilm, {1, 1}, Polarity::kBoneWhite)), Error);
}

TEST(DrrPicture, TheWindowIsThatOfThePatient) {
  ProjectionImage image{100, 10, std::vector<float>(1000, 0.0F)};
  for (std::size_t i = 0; i < 500; ++i) image.values[i] = 1.0F + float(i) / 500;
  const Window film = window_of(image, Response::kFilm);
  EXPECT_NEAR(film.low, 1.005, 0.005);
  EXPECT_NEAR(film.high, 1.995, 0.005);
  const Window transmission = window_of(image, Response::kTransmission);
  EXPECT_NEAR(transmission.low, std::exp(-1.995), 0.005);
  EXPECT_NEAR(transmission.high, std::exp(-1.005), 0.005);
  const Window nothing = window_of({2, 1, {0, 0}}, Response::kFilm);
  EXPECT_LT(nothing.low, nothing.high);
}

TEST(DrrPicture, PngFilesHoldEveryGrey) {
  const test::TemporaryFolder folder;
  GreyPicture picture{256, 256, {}};
  for (unsigned value = 0; value < 65536; ++value)
    picture.values.push_back(static_cast<std::uint16_t>(value));
  const Bytes bytes = png_of(picture);
  EXPECT_EQ(png_of(picture), bytes);
  write(folder / "a.png", text_of(bytes));
  const GreyPicture read = read_png(folder / "a.png");
  EXPECT_EQ(read.columns, 256U);
  EXPECT_EQ(read.values, picture.values);
}

TEST(DrrPicture, ColoursAreReadAsTheirLuminance) {
  const test::TemporaryFolder folder;
  write(folder / "c.png", text_of(png_of(ColourPicture{2, 1, {{255, 255, 255}, {0, 255, 0}}})));
  const GreyPicture read = read_png(folder / "c.png");
  EXPECT_EQ(read.values[0], 65535);
  EXPECT_NEAR(read.values[1], 0.72 * 65535, 0.02 * 65535);
}

TEST(DrrPicture, RefusesFilesThatAreNoPng) {
  const test::TemporaryFolder folder;
  const std::string whole(text_of(png_of(GreyPicture{64, 64, std::vector<std::uint16_t>(4096, 7)})));
  const auto refusal = [&](const std::string& content) -> std::string {
    write(folder / "x.png", content);
    try {
      static_cast<void>(read_png(folder / "x.png"));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal(whole), "");
  for (std::size_t size = 0; size + 12 < whole.size(); size += 7) {
    EXPECT_THAT(refusal(whole.substr(0, size)), HasSubstr("x.png: it is damaged, cut off or no PNG")) << size;
  }
  EXPECT_THAT(refusal("GIF89a"), HasSubstr("no PNG"));
  EXPECT_THROW(static_cast<void>(read_png(folder / "absent.png")), IoError);
}

TEST(DrrPicture, MetaImageFilesHoldEveryFloat) {
  const test::TemporaryFolder folder;
  const ProjectionImage image{3, 2, {0, 0.1F, 2.5F, 1e-6F, 7, 3}};
  write(folder / "i.mha", mha_of(image, std::array<double, 2>{1.171875, 0.5}));
  const ProjectionImage read = read_mha(folder / "i.mha");
  EXPECT_EQ(read.columns, 3U);
  EXPECT_EQ(read.rows, 2U);
  EXPECT_EQ(read.values, image.values);
}

}  // namespace
}  // namespace kiroku::sim
