// An organ looked for in a picture of which nothing is known.
#include "sim/align/pose_search.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "tests/support/endoscope_scene.h"

namespace kiroku::sim {
namespace {

using test::EndoscopeScene;

/// A part of a picture, so that the camera's axis is not in its middle.
Picture part_of(const Picture& picture, int left, int top, int width, int height) {
  Picture part(width, height);
  for (int y = 0; y < height; ++y) std::copy_n(picture.pixel(left, top + y), 3 * width, part.pixel(0, y));
  return part;
}

TEST(PoseSearch, FindsTheOrganBesideTheAxis) {
  const TetMesh mesh = test::liver_like_mesh({16, 5, 12});
  const OrganSurface surface = organ_surface(mesh);
  EndoscopeScene scene(test::liver_like_mesh({32, 10, 24}));
  EndoscopeScene::Look look;
  look.camera = scene.camera(8, -18, 0.16, 12, {-0.35, 0.1});
  constexpr int kTop = 40, kWidth = 480, kHeight = 400;
  const Picture picture = part_of(scene.picture(look), 0, kTop, kWidth, kHeight);
  Pinhole pinhole = pinhole_of(EndoscopeScene::kFieldDeg, EndoscopeScene::kWidth, EndoscopeScene::kHeight);
  pinhole.middle_y -= kTop;
  const Cover cover = cover_of(picture);
  const auto fits = PoseSearch(surface, {}).find(picture, cover, colour_cells(picture, cover), pinhole);
  ASSERT_FALSE(fits.empty());
  EXPECT_LT(way_between_m(surface, fits[0].camera, look.camera), 0.003);
  // Where the picture's middle is, as those have it who draw with that camera.
  EXPECT_NEAR(fits[0].camera.centre.x(), ((kWidth - 1) / 2.0 - pinhole.middle_x) / pinhole.focal_px, 1e-12);
  EXPECT_NEAR(fits[0].camera.centre.y(), (pinhole.middle_y - (kHeight - 1) / 2.0) / pinhole.focal_px, 1e-12);
}

}  // namespace
}  // namespace kiroku::sim
