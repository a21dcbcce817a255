// Tissue is told by its hue, in much and in little light.
#include "sim/align/colour_model.h"

#include <cmath>

#include <gtest/gtest.h>

namespace kiroku::sim {
namespace {

constexpr int kSide = 120;
constexpr Rgb kOrgan{158, 64, 54}, kWall{150, 72, 74};

Picture in_one_colour(const Rgb& colour) {
  Picture picture(kSide, kSide);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) std::copy(colour.begin(), colour.end(), picture.pixel(x, y));
  }
  return picture;
}

/// A square of the organ before a wall that is nearly as red, both in so much light.
Picture organ_before_wall(double light) {
  Picture picture = in_one_colour(kWall);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const bool organ = x >= 40 && x < 80 && y >= 40 && y < 80;
      for (std::size_t c = 0; c < 3; ++c)
        picture.pixel(x, y)[c] =
            static_cast<std::uint8_t>(std::lround(light * (organ ? kOrgan[c] : kWall[c])));
    }
  }
  return picture;
}

Silhouette square() {
  Silhouette silhouette;
  silhouette.width = silhouette.height = kSide;
  silhouette.depth_m.assign(std::size_t(kSide) * kSide, 0);
  for (std::size_t y = 40; y < 80; ++y) {
    for (std::size_t x = 40; x < 80; ++x) silhouette.depth_m[y * kSide + x] = 0.1F;
  }
  return silhouette;
}

ColourCells cells_of(const Picture& picture) { return colour_cells(picture, cover_of(picture)); }

TEST(ColourModel, KnowsTissueInLightOfOneCellMoreOrLess) {
  const ColourModel model = colours_of(cells_of(organ_before_wall(1)), square(), 40);
  for (const double light : {0.6, 0.8, 1.2}) {
    const ColourCells cells = cells_of(organ_before_wall(light));
    EXPECT_GT(model.evidence[cells.at(60, 60)], 1) << light;
    EXPECT_LT(model.evidence[cells.at(20, 60)], -1) << light;
  }
}

/// In half as much light again the organ is one cell lighter, and known. The wall is two cells lighter: it is
/// unknown, and not taken for the organ's.
TEST(ColourModel, DoesNotKnowTissueInLightOfTwoCellsMore) {
  const ColourCells first = cells_of(organ_before_wall(1)), brighter = cells_of(organ_before_wall(1.5));
  const ColourModel model = colours_of(first, square(), 40);
  const auto lights_of = [](std::uint16_t cell) { return cell % kLightCells; };
  ASSERT_EQ(lights_of(brighter.at(60, 60)), lights_of(first.at(60, 60)) + 1);
  EXPECT_GT(model.evidence[brighter.at(60, 60)], 1);
  ASSERT_EQ(lights_of(brighter.at(20, 60)), lights_of(first.at(20, 60)) + 2);
  EXPECT_EQ(model.evidence[brighter.at(20, 60)], 0);
}

TEST(ColourModel, TellsTissueFromTissueInTheShade) {
  const ColourCells cells = cells_of(organ_before_wall(0.3));
  const ColourModel model = colours_of(cells, square(), 40);
  EXPECT_GT(model.evidence[cells.at(60, 60)], 1);
  EXPECT_LT(model.evidence[cells.at(20, 60)], -1);
}

TEST(ColourCells, AreThoseOfTissueWhereSinglePixelsAreNoise) {
  Picture picture = in_one_colour(kOrgan);
  const std::uint16_t clean = cells_of(picture).at(60, 60);
  for (int y = 2; y < kSide; y += 5) {
    for (int x = 2; x < kSide; x += 5) picture.pixel(x, y)[0] = 90;
  }
  const ColourCells cells = cells_of(picture);
  EXPECT_EQ(cells.at(60, 60), clean);
  EXPECT_EQ(cells.at(62, 62), clean);
}

TEST(ColourCells, AreNoneUnderCover) {
  const Picture picture = in_one_colour({150, 152, 158});
  const ColourCells cells = cells_of(picture);
  EXPECT_EQ(cells.at(60, 60), ColourCells::kCovered);
  EXPECT_EQ(cells.cell.size(), std::size_t(kSide) * kSide);
}

TEST(ColourCells, AreTakenOfTheSmallestPictures) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 7}, {5, 1}, {3, 3}}) {
    const Picture picture(width, height);
    EXPECT_EQ(cells_of(picture).cell.size(), std::size_t(width) * std::size_t(height));
  }
}

TEST(ColourModel, KnowsNothingWhereAllIsCovered) {
  const ColourModel model = colours_of(cells_of(in_one_colour({150, 152, 158})), square(), 40);
  for (const float evidence : model.evidence) ASSERT_EQ(evidence, 0);
}

}  // namespace
}  // namespace kiroku::sim
