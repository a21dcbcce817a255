// A rendered organ whose place is known: found, followed, and lost where it cannot be seen.
#include "sim/align/organ_track.h"

#include <gmock/gmock.h>

#include "base/error.h"
#include "tests/support/endoscope_scene.h"

namespace kiroku::sim {
namespace {

using test::EndoscopeScene;

TetMesh plan_mesh() { return test::liver_like_mesh({16, 5, 12}); }

class OrganTrackTest : public testing::Test {
 protected:
  EndoscopeScene::Look look(double azimuth_deg) const {
    EndoscopeScene::Look seen;
    seen.camera = scene_.camera(azimuth_deg, -18, 0.16, 5);
    return seen;
  }
  EndoscopeScene scene_{test::liver_like_mesh({32, 10, 24})};
  OrganSurface surface_ = organ_surface(plan_mesh());
};

TEST_F(OrganTrackTest, FindsAndFollowsAnOrganWithinThreeOfItsStatedErrors) {
  OrganTrack track(plan_mesh(), EndoscopeScene::kFieldDeg);
  for (int i = 0; i < 4; ++i) {
    const EndoscopeScene::Look seen = look(8 + 2 * i);
    const AlignedMoment moment = track.take(i, scene_.picture(seen));
    ASSERT_TRUE(moment.held()) << i << ": " << name_of(moment.why) << ", misfit " << moment.misfit_px;
    const double error_m = way_between_m(surface_, moment.camera, seen.camera);
    EXPECT_LT(error_m, 2e-3) << i;
    EXPECT_LT(error_m, 3 * moment.standard_error_m) << i;
    EXPECT_LE(moment.standard_error_m, OrganTrack::kLargestErrorM);
  }
}

/// Livers, fat and a black border in hard patches, as films of operations have them.
Picture patches_of_tissue() {
  constexpr std::array<Rgb, 5> kTissues{
      {{72, 32, 32}, {128, 62, 64}, {214, 176, 112}, {8, 6, 6}, {100, 50, 52}}};
  Picture picture(EndoscopeScene::kWidth, EndoscopeScene::kHeight);
  constexpr int kPatchPx = 56;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const int bent = x + static_cast<int>(20 * std::sin(y / 40.0));
      const auto& tissue = kTissues[static_cast<std::size_t>((bent / kPatchPx + 2 * (y / 150)) % 5)];
      std::copy(tissue.begin(), tissue.end(), picture.pixel(x, y));
    }
  }
  return picture;
}

TEST_F(OrganTrackTest, FindsAnOrganOfLightAndDarkPatchesBeforeOtherTissue) {
  EndoscopeScene patched(test::liver_like_mesh({32, 10, 24}), patches_of_tissue());
  OrganTrack track(plan_mesh(), EndoscopeScene::kFieldDeg);
  for (int i = 0; i < 3; ++i) {
    const EndoscopeScene::Look seen = look(8 + 2 * i);
    const AlignedMoment moment = track.take(i, patched.picture(seen));
    ASSERT_TRUE(moment.held()) << i << ": " << name_of(moment.why) << ", misfit " << moment.misfit_px
                               << ", supported " << moment.supported;
    const double error_m = way_between_m(surface_, moment.camera, seen.camera);
    EXPECT_LT(error_m, 3e-3) << i;
    EXPECT_LT(error_m, 3 * moment.standard_error_m) << i;
  }
}

/// Each pixel twice in both directions, or every second one.
Picture resized(const Picture& picture, bool larger) {
  Picture made(larger ? 2 * picture.width : picture.width / 2,
               larger ? 2 * picture.height : picture.height / 2);
  for (int y = 0; y < made.height; ++y) {
    for (int x = 0; x < made.width; ++x)
      std::copy_n(larger ? picture.pixel(x / 2, y / 2) : picture.pixel(2 * x, 2 * y), 3, made.pixel(x, y));
  }
  return made;
}

TEST_F(OrganTrackTest, GoesOnInPicturesOfAnotherSize) {
  OrganTrack track(plan_mesh(), EndoscopeScene::kFieldDeg);
  ASSERT_TRUE(track.take(0, scene_.picture(look(8))).held());
  for (int i = 1; i < 4; ++i) {
    const EndoscopeScene::Look seen = look(8 + i);
    // Two of half the size, then the first size again.
    const Picture whole = scene_.picture(seen);
    const AlignedMoment moment = track.take(i, i < 3 ? resized(whole, false) : whole);
    ASSERT_TRUE(moment.held()) << i << ": " << name_of(moment.why) << ", misfit " << moment.misfit_px;
    EXPECT_LT(way_between_m(surface_, moment.camera, seen.camera), 4e-3) << i;
  }
}

TEST_F(OrganTrackTest, StatesItsMisfitInPixelsOfThePictureThatWasGiven) {
  OrganTrack given(plan_mesh(), EndoscopeScene::kFieldDeg), doubled(plan_mesh(), EndoscopeScene::kFieldDeg);
  const Picture picture = scene_.picture(look(8));
  // Twice as large it is scaled down to what was given.
  const AlignedMoment small = given.take(0, picture), large = doubled.take(0, resized(picture, true));
  ASSERT_TRUE(small.held());
  ASSERT_TRUE(large.held());
  EXPECT_NEAR(large.misfit_px, 2 * small.misfit_px, 1e-6);
}

TEST_F(OrganTrackTest, FindsAnOrganBehindInstrumentsAndHighlightsFromTheFirstPictureOn) {
  constexpr Rgb kSteelTool{150, 152, 158}, kBlackTool{26, 26, 28}, kBlueTool{60, 92, 150};
  for (const Rgb& colour : {kSteelTool, kBlackTool, kBlueTool}) {
    OrganTrack track(plan_mesh(), EndoscopeScene::kFieldDeg);
    for (int i = 0; i < 3; ++i) {
      EndoscopeScene::Look seen = look(8 + i);
      seen.shine = 1.5;
      const double sway = 0.004 * i;
      seen.tools = {
          EndoscopeScene::tool(seen.camera, {-0.02 + sway, 0.01, -0.11}, {0.9, -0.2, 0.45}, colour),
          EndoscopeScene::tool(seen.camera, {0.02, -0.02 + sway, -0.12}, {-0.9, -0.4, 0.4}, kSteelTool)};
      const AlignedMoment moment = track.take(i, scene_.picture(seen));
      ASSERT_TRUE(moment.held()) << i << ": " << name_of(moment.why) << ", misfit " << moment.misfit_px
                                 << ", tool " << int(colour[0]);
      const double error_m = way_between_m(surface_, moment.camera, seen.camera);
      EXPECT_LT(error_m, 3e-3) << i;
      EXPECT_LT(error_m, 3 * moment.standard_error_m) << i;
    }
  }
}

TEST_F(OrganTrackTest, SaysNothingOfAnOrganThatIsCoveredAlmostWhole) {
  const EndoscopeScene::Look seen = look(8);
  Picture picture = scene_.picture(seen);
  // A gauze over the left three quarters.
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < 3 * picture.width / 4; ++x) std::fill_n(picture.pixel(x, y), 3, 200);
  }
  OrganTrack track(plan_mesh(), EndoscopeScene::kFieldDeg);
  EXPECT_FALSE(track.take(0, picture).held());
  // Also where it was known before.
  OrganTrack followed(plan_mesh(), EndoscopeScene::kFieldDeg);
  ASSERT_TRUE(followed.take(0, scene_.picture(seen)).held());
  EXPECT_EQ(followed.take(1, picture).why, WhyLost::kHidden);
}

TEST_F(OrganTrackTest, LosesTheOrganInSmokeAndFindsItAgain) {
  OrganTrack track(plan_mesh(), EndoscopeScene::kFieldDeg);
  ASSERT_TRUE(track.take(0, scene_.picture(look(8))).held());
  EndoscopeScene::Look smoke = look(9);
  smoke.smoke = 1;
  const AlignedMoment hidden = track.take(1, scene_.picture(smoke));
  EXPECT_EQ(hidden.why, WhyLost::kHidden) << name_of(hidden.why);
  const EndoscopeScene::Look again = look(10);
  const AlignedMoment moment = track.take(2, scene_.picture(again));
  ASSERT_TRUE(moment.held()) << name_of(moment.why);
  EXPECT_LT(way_between_m(surface_, moment.camera, again.camera), 3e-3);
}

TEST_F(OrganTrackTest, FindsNothingInAPictureWithoutTheOrgan) {
  EndoscopeScene::Look empty = look(8);
  empty.organ = false;
  OrganTrack track(plan_mesh(), EndoscopeScene::kFieldDeg);
  const AlignedMoment moment = track.take(0, scene_.picture(empty));
  EXPECT_FALSE(moment.held());
  // The next picture is not searched at once, and says so.
  EXPECT_EQ(track.take(1, scene_.picture(empty)).why, WhyLost::kNotLooked);
}

Picture mirror_of(const Picture& picture) {
  Picture mirror(picture.width, picture.height);
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x)
      std::copy_n(picture.pixel(picture.width - 1 - x, y), 3, mirror.pixel(x, y));
  }
  return mirror;
}

TEST_F(OrganTrackTest, RefusesAMirroredPictureAndThePlanOfAnotherOrgan) {
  const Picture picture = scene_.picture(look(8));
  OrganTrack track(plan_mesh(), EndoscopeScene::kFieldDeg);
  const AlignedMoment mirrored = track.take(0, mirror_of(picture));
  EXPECT_EQ(mirrored.why, WhyLost::kMirrored) << name_of(mirrored.why);
  EXPECT_GT(mirrored.misfit_px, mirrored.rival_px) << "the mirror image fits better";
  OrganTrack kidney(test::kidney_like_mesh({8, 8, 14}), EndoscopeScene::kFieldDeg);
  EXPECT_EQ(kidney.take(0, picture).why, WhyLost::kNoOrgan);
}

TEST_F(OrganTrackTest, RefusesAMirroredPictureWithInstrumentsBeforeTheOrgan) {
  EndoscopeScene::Look seen = look(8);
  seen.tools = {EndoscopeScene::tool(seen.camera, {-0.02, 0.01, -0.11}, {0.9, -0.2, 0.45}),
                EndoscopeScene::tool(seen.camera, {0.02, -0.02, -0.12}, {-0.9, -0.4, 0.4})};
  const Picture picture = scene_.picture(seen);
  OrganTrack track(plan_mesh(), EndoscopeScene::kFieldDeg), as_it_is(plan_mesh(), EndoscopeScene::kFieldDeg);
  const AlignedMoment mirrored = track.take(0, mirror_of(picture));
  EXPECT_EQ(mirrored.why, WhyLost::kMirrored) << name_of(mirrored.why);
  EXPECT_TRUE(as_it_is.take(0, picture).held()) << "so that nothing but the mirror refuses it";
}

TEST(OrganTrack, RefusesWhatCannotBe) {
  EXPECT_THROW(OrganTrack(plan_mesh(), 5), UsageError);
  EXPECT_THROW(OrganTrack(TetMesh{}, 60), UsageError);
}

TEST(OrganSurface, MovesAsItsMotionSays) {
  const OrganSurface surface = organ_surface(plan_mesh());
  Camera camera;
  camera.eye_m = surface.middle_m + Vector3(0.01, 0.02, 0.2);
  Motion motion;
  motion << 1e-4, -2e-4, 3e-4, -1e-4, 2e-4, 1e-4;
  const Camera moved = after_motion(surface, camera, motion);
  const double way_m = std::sqrt(motion.dot(squared_way(surface, camera) * motion));
  EXPECT_NEAR(way_between_m(surface, camera, moved), way_m, 1e-3 * way_m);
  // The derivative of a pixel, by differences.
  const Pinhole pinhole = pinhole_of(60, 640, 480);
  const Vector3 node = surface.nodes[7], before = camera.view_m(node);
  const Eigen::Vector2d went = pinhole.pixel(moved.view_m(node)) - pinhole.pixel(before);
  const Eigen::Vector2d said =
      pinhole.derivative(before, camera.view_m(surface.middle_m), surface.radius_m) * motion;
  EXPECT_LT((went - said).norm(), 0.02 * said.norm() + 1e-3);
}

}  // namespace
}  // namespace kiroku::sim
