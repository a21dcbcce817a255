// What hides tissue is told by its colour, a dark shaft by its shape.
#include "sim/align/cover.h"

#include <gtest/gtest.h>

namespace kiroku::sim {
namespace {

constexpr int kWidth = 160, kHeight = 120;
constexpr Rgb kLiver{158, 64, 54}, kFat{222, 184, 120}, kSteel{150, 152, 158}, kBlue{60, 92, 150},
    kBlack{12, 10, 10};

Picture filled(const Rgb& colour) {
  Picture picture(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) std::copy(colour.begin(), colour.end(), picture.pixel(x, y));
  }
  return picture;
}

void paint(Picture& picture, int left, int top, int right, int bottom, const Rgb& colour) {
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) std::copy(colour.begin(), colour.end(), picture.pixel(x, y));
  }
}

double share(const Cover& cover) {
  double covered = 0;
  for (const std::uint8_t each : cover.covered) covered += each;
  return covered / double(cover.covered.size());
}

TEST(Cover, IsNoTissue) {
  for (const Rgb& colour : {kLiver, kFat, Rgb{178, 104, 98}, Rgb{70, 28, 22}})
    EXPECT_EQ(share(cover_of(filled(colour))), 0) << int(colour[0]);
}

TEST(Cover, IsWhatIsGreyOrNotRed) {
  for (const Rgb& colour : {kSteel, kBlue, Rgb{195, 195, 195}, Rgb{250, 248, 246}, Rgb{70, 140, 90}})
    EXPECT_EQ(share(cover_of(filled(colour))), 1) << int(colour[0]);
}

TEST(Cover, OfAnInstrumentHasASeamAndNoMore) {
  Picture picture = filled(kLiver);
  paint(picture, 40, 40, 80, 60, kSteel);
  const Cover cover = cover_of(picture);
  EXPECT_TRUE(cover.at(60, 50));
  EXPECT_TRUE(cover.at(37, 50));
  EXPECT_FALSE(cover.at(33, 50));
  EXPECT_FALSE(cover.at(60, 70));
}

TEST(Cover, IsADarkShaftAndNoDarkCavity) {
  Picture shaft = filled(kLiver), cavity = filled(kLiver), within = filled(kLiver);
  paint(shaft, 60, 50, kWidth, 66, kBlack);
  paint(cavity, 80, 0, kWidth, 90, kBlack);
  paint(within, 30, 50, 120, 66, kBlack);
  EXPECT_TRUE(cover_of(shaft).at(100, 58));
  EXPECT_EQ(share(cover_of(cavity)), 0) << "neither slender nor straight";
  EXPECT_EQ(share(cover_of(within)), 0) << "no instrument begins within the picture";
}

TEST(Cover, IsNotMadeBySinglePixels) {
  Picture picture = filled(kLiver);
  for (int y = 10; y < kHeight - 10; y += 20) {
    for (int x = 10; x < kWidth - 10; x += 20) paint(picture, x, y, x + 2, y + 2, kSteel);
  }
  EXPECT_EQ(share(cover_of(picture)), 0);
}

TEST(Cover, IsTakenOfTheSmallestPictures) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 7}, {5, 1}, {3, 3}}) {
    Picture picture(width, height);
    paint(picture, 0, 0, width, height, kLiver);
    EXPECT_FALSE(cover_of(picture).at(width - 1, height - 1)) << width << " x " << height;
  }
}

}  // namespace
}  // namespace kiroku::sim
