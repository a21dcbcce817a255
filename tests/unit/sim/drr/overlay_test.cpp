#include "sim/drr/overlay.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/tet_grid.h"
#include "tests/unit/sim/drr/drr_test_volume.h"

namespace kiroku::sim {
namespace {

/// Grey from 0 to 5 to the right, or the other way round.
ProjectionImage ramp(bool falling) {
  ProjectionImage image{101, 64, {}};
  for (std::size_t i = 0; i < 101 * 64; ++i) {
    const float part = float(i % 101) / 100;
    image.values.push_back(0.1F + 5 * (falling ? 1 - part : part));
  }
  return image;
}

TEST(Overlay, ShowsBothByItsModes) {
  const ProjectionImage rising = ramp(false), falling = ramp(true);
  const auto pixel = [](const ColourPicture& picture, std::size_t column, std::size_t row) {
    return picture.pixels[row * picture.columns + column];
  };
  const ColourPicture half = overlay_of(rising, falling, OverlayMode::kOpacity, 0.5);
  EXPECT_NEAR(pixel(half, 10, 3)[0], 127, 2);
  EXPECT_NEAR(pixel(half, 90, 3)[0], 127, 2);
  const ColourPicture drr = overlay_of(rising, falling, OverlayMode::kOpacity, 1);
  EXPECT_EQ(pixel(drr, 0, 3)[0], 255);
  EXPECT_EQ(pixel(drr, 100, 3)[0], 0);
  const ColourPicture difference = overlay_of(rising, falling, OverlayMode::kDifference, 0);
  EXPECT_EQ(pixel(difference, 0, 3), (Colour{255, 140, 0}));
  EXPECT_EQ(pixel(difference, 100, 3), (Colour{0, 110, 255}));
  EXPECT_EQ(pixel(difference, 50, 3), (Colour{128, 128, 128}));
  const ColourPicture board = overlay_of(rising, falling, OverlayMode::kCheckerboard, 0);
  EXPECT_LT(pixel(board, 10, 3)[0], 40);
  EXPECT_GT(pixel(board, 10, 40)[0], 215);
  const ColourPicture beside = overlay_of(rising, falling, OverlayMode::kBeside, 0);
  const ColourPicture wiped = overlay_of(rising, falling, OverlayMode::kWipe, 0.5);
  EXPECT_EQ(wiped.columns, 101U);
  EXPECT_EQ(pixel(wiped, 0, 3)[0], 255);
  EXPECT_EQ(pixel(wiped, 100, 3)[0], 255);
  EXPECT_NEAR(pixel(wiped, 49, 3)[0], 130, 3);
  EXPECT_EQ(beside.columns, 202U);
  EXPECT_EQ(pixel(beside, 0, 3)[0], 0);
  EXPECT_EQ(pixel(beside, 101, 3)[0], 255);
  EXPECT_THROW(static_cast<void>(overlay_of(rising, {2, 2, {1, 2, 3, 4}}, OverlayMode::kOpacity, 0)), Error);
}

TEST(Overlay, ContoursAreTheEdgesOfTheDrr) {
  ProjectionImage step{64, 64, {}};
  for (std::size_t i = 0; i < 64 * 64; ++i) step.values.push_back(i % 64 < 32 ? 0.1F : 3.0F);
  const ColourPicture picture =
      overlay_of({64, 64, std::vector<float>(64 * 64, 1)}, step, OverlayMode::kContour, 0);
  EXPECT_EQ(picture.pixels[20 * 64 + 32], (Colour{0, 220, 255}));
  EXPECT_EQ(picture.pixels[20 * 64 + 10], picture.pixels[20 * 64 + 55]);
  EXPECT_NE(picture.pixels[20 * 64 + 10], picture.pixels[20 * 64 + 32]);
}

TEST(Overlay, DrawsLinesWithinThePicture) {
  ColourPicture picture{20, 10, std::vector<Colour>(200)};
  const std::vector<PixelLine> lines{{{5, 5}, {14, 5}}, {{-1e9, -3}, {1e9, -3}}, {{3, 3}, {3, 3}}};
  draw(picture, lines, {255, 0, 0});
  EXPECT_EQ(picture.pixels[5 * 20 + 10], (Colour{255, 0, 0}));
  EXPECT_EQ(picture.pixels[3 * 20 + 3], (Colour{255, 0, 0}));
  EXPECT_EQ(picture.pixels[8 * 20 + 10], (Colour{0, 0, 0}));
  EXPECT_EQ(picture.pixels[0], (Colour{0, 0, 0}));
}

TEST(Overlay, TheOutlineOfABoxIsTheEdgeOfItsShadow) {
  TetMesh mesh = test::tet_grid({2, 2, 2}, {0.04, 0.04, 0.04});
  for (Vector3& node : mesh.nodes) node -= Vector3::Constant(0.02);
  const ProjectionGeometry geometry = test::small_geometry(0);
  const std::vector<PixelLine> lines = outline_of(mesh, 0, geometry);
  // The square nearest to the source: 20 mm before the axis.
  const double half = 0.02 * 1.5 / 0.98 / (0.15 / 128);
  EXPECT_EQ(lines.size(), 8U);
  for (const PixelLine& line : lines) {
    for (const auto& end : {line.from, line.to}) {
      EXPECT_NEAR(std::max(std::abs(end[0] - 63.5), std::abs(end[1] - 47.5)), half, 1e-6);
    }
  }
  EXPECT_TRUE(outline_of(mesh, 7, geometry).empty());
}

TEST(Overlay, APathRunsFromPlaceToPlace) {
  const ProjectionGeometry geometry = test::small_geometry(0);
  const std::vector<Vector3> places{{0, 0, 0}, {0, 0, 0.01}, {0, -5, 0}, {0.01, 0, 0}};
  const std::vector<PixelLine> lines = path_of(places, geometry);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_NEAR(lines[0].from[1] - lines[0].to[1], 0.01 * 1.5 / (0.15 / 128), 1e-9);
}

}  // namespace
}  // namespace kiroku::sim
