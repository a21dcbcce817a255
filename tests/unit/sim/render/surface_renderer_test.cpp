#include "sim/render/surface_renderer.h"

#include <algorithm>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

/// Looks along -z at a cube of 10 cm from 50 cm above its middle.
SurfaceScene scene_above() {
  SurfaceScene scene;
  scene.camera.eye_m = {0.05, 0.05, 0.6};
  scene.camera.half_extent = {0.2, 0.15};
  scene.width = 320;
  scene.height = 240;
  return scene;
}
TetMesh cube() { return test::tet_grid({2, 2, 2}, {0.1, 0.1, 0.1}); }

TEST(SurfaceRenderer, ShowsTheBodyWhereItIsAndInItsColours) {
  SurfaceRenderer renderer(cube(), GpuUse::kOff);
  SurfaceScene scene = scene_above();
  scene.node_colours.assign(27, Rgb{0, 200, 0});
  const SurfacePicture found = renderer.render({}, scene);
  const std::uint8_t* middle = found.picture.pixel(160, 120);
  EXPECT_GT(middle[1], 100);
  EXPECT_LT(middle[0], 60);
  EXPECT_TRUE(std::ranges::equal(std::span(found.picture.pixel(3, 3), 3), scene.background));
  // The face at z = 10 cm is 50 cm away, so its half width is 0.1 of the distance: half of the picture's.
  EXPECT_TRUE(std::ranges::equal(std::span(found.picture.pixel(78, 120), 3), scene.background));
  EXPECT_FALSE(std::ranges::equal(std::span(found.picture.pixel(82, 120), 3), scene.background));
  EXPECT_EQ(found.pixels_of_mark[0], 320U * 240U);
}

TEST(SurfaceRenderer, CountsWhatOfASolidIsNotHidden) {
  SurfaceRenderer renderer(cube(), GpuUse::kOff);
  SurfaceScene scene = scene_above();
  // A ball of 1 cm beside the cube's edge, as high as its upper face: half of it inside the cube, half seen.
  scene.solids.push_back(
      {{Sphere{0.01}, {{0.1, 0.05, 0.08}, Eigen::Quaterniond::Identity()}, {9, 9, 250}}, 7});
  const auto half_hidden = static_cast<double>(renderer.render({}, scene).pixels_of_mark[7]);
  scene.shows_body = false;
  const auto whole = static_cast<double>(renderer.render({}, scene).pixels_of_mark[7]);
  // 320 pixels are 0.4 at distance 1; the ball is 52 cm away.
  const double radius = 0.01 / 0.52 * 320 / 0.4;
  EXPECT_NEAR(whole, std::numbers::pi * radius * radius, 0.03 * whole);
  // The upper edge, nearer to the eye and so farther out in the picture, covers 0.385 of the radius more.
  EXPECT_NEAR(half_hidden / whole, 0.5, 0.3);
  EXPECT_LT(half_hidden, 0.5 * whole);
  scene.solids[0].ghost = true;
  EXPECT_NEAR(static_cast<double>(renderer.render({}, scene).pixels_of_mark[7]), whole / 2, 0.02 * whole);
}

TEST(SurfaceRenderer, FollowsTheDisplacementAndRepeatsItsBytes) {
  SurfaceRenderer renderer(cube(), GpuUse::kOff);
  SurfaceScene scene = scene_above();
  scene.solids.push_back(
      {{Sphere{0.02}, {{0.05, 0.05, 0.12}, Eigen::Quaterniond::Identity()}, {9, 9, 250}}, 1});
  const SurfacePicture first = renderer.render({}, scene), again = renderer.render({}, scene);
  EXPECT_EQ(first.picture.rgb, again.picture.rgb);
  EXPECT_GT(first.pixels_of_mark[1], 0U);
  std::vector<double> up(27 * 3);
  for (std::size_t at = 2; at < up.size(); at += 3) up[at] = 0.05;
  EXPECT_EQ(renderer.render(up, scene).pixels_of_mark[1], 0U);
}

TEST(SurfaceRenderer, RefusesWhatCannotBeDrawn) {
  SurfaceRenderer renderer(cube(), GpuUse::kOff);
  SurfaceScene scene = scene_above();
  EXPECT_THROW(renderer.render(std::vector<double>(5), scene), UsageError);
  EXPECT_THROW(renderer.render(std::vector<double>(81, std::numeric_limits<double>::quiet_NaN()), scene),
               UsageError);
  scene.node_colours.resize(3);
  EXPECT_THROW(renderer.render({}, scene), UsageError);
  scene.node_colours.clear();
  scene.width = 0;
  EXPECT_THROW(renderer.render({}, scene), UsageError);
}

}  // namespace
}  // namespace kiroku::sim
