#include "sim/render/tip_lighting.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/render/volume_renderer.h"
#include "tests/support/ball_mesh.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

const Vector3 kOrgan = Vector3::Constant(0.024);
constexpr double kOrganM = 0.016;

std::shared_ptr<const ShadedVolume> ct_of(const Volume& volume) {
  return std::make_shared<const ShadedVolume>(shade(volume, {Vector3::Zero(), Vector3::Constant(0.047)}));
}
/// Opaque and grey, by whatever is said of its light.
TransferFunction grey_tissue(const std::string& light) {
  return parse_transfer_function(
      R"({"name": "Grey", "points": [{"hu": -20, "color": "#808080", "opacity_per_mm": 0},
                                     {"hu": 0, "color": "#808080", "opacity_per_mm": 1}],
          "light": {)" +
          light + "}}",
      "grey.json");
}

Scene before_organ(const TetMesh& mesh, double distance_m, int side = 96) {
  Scene scene;
  scene.width = scene.height = side;
  scene.background = {0, 0, 0};
  scene.camera = camera_looking_at(ball_around(mesh), {}, side, side);
  scene.camera.eye_m = kOrgan + distance_m * scene.camera.to_view.row(2).transpose();
  return scene;
}
/// By each engine.
template <typename Visit>
void for_each_engine(const Visit& visit) {
  for (const Engine engine : {Engine::kOpenGl, Engine::kProcessor}) {
    SCOPED_TRACE(engine == Engine::kOpenGl ? "OpenGL" : "processor");
    visit(engine);
  }
}
Picture lit_picture(Engine engine, const std::shared_ptr<const ShadedVolume>& ct,
                    const TransferFunction& tissue, const TetMesh& mesh, const Scene& scene) {
  VolumeRenderer renderer(ct, tissue, {GpuUse::kOff, engine});
  renderer.set_mesh(mesh);
  return renderer.render({}, scene);
}
double light_of(const Picture& picture, int x, int y) { return linear_light(picture.pixel(x, y)[1] / 255.0); }

TEST(TipLighting, TwiceAsFarIsAQuarterOfTheLight) {
  TipLight light;
  light.at_m = {0.001, 0.002, 0};
  light.working_distance_m = 0.05;
  const Vector3 towards = Vector3(0.3, -0.2, -1).normalized();
  const double at_working_distance = tip_ray(light, light.at_m + 0.05 * towards).brightness;
  EXPECT_NEAR(at_working_distance, 1, 1e-12);
  EXPECT_NEAR(tip_ray(light, light.at_m + 0.1 * towards).brightness, 0.25, 1e-12);
  EXPECT_LT((tip_ray(light, light.at_m + 0.1 * towards).to_light + towards).norm(), 1e-12);
  for_each_engine([](Engine engine) {
    const auto ct =
        ct_of(test::volume_of({48, 48, 48}, 1e-3, Vector3::Zero(), [](const Vector3&) { return 50; }));
    const TransferFunction tissue = grey_tissue(R"("ambient": 1, "diffuse": 0)");
    TetMesh mesh = test::tet_grid({2, 2, 2}, {0.028, 0.012, 0.028});
    for (Vector3& node : mesh.nodes) node += Vector3(0.010, 0.018, 0.010);
    const auto centre_at = [&](double to_surface_m) {
      Scene scene = before_organ(mesh, to_surface_m + 0.006);
      scene.tip_light.emplace();
      scene.tip_light->at_m.setZero();
      scene.tip_light->working_distance_m = 0.1;
      return light_of(lit_picture(engine, ct, tissue, mesh, scene), 48, 48);
    };
    const double grey = linear_light(128 / 255.0);
    EXPECT_NEAR(centre_at(0.1), grey, 0.01 * grey);
    EXPECT_NEAR(centre_at(0.2) / grey, 1 / 4.0, 0.01);
    EXPECT_NEAR(centre_at(0.07) / grey, 1 / 0.49, 0.03);
  });
}

TEST(TipLighting, TheHighlightIsWhereTheNormalHalvesTheWayToLightAndEye) {
  const auto ct = ct_of(test::volume_of({48, 48, 48}, 1e-3, Vector3::Zero(), [](const Vector3& at) {
    return -100 + 200 * std::clamp((0.014 - (at - kOrgan).norm()) / 0.003 + 0.5, 0.0, 1.0);
  }));
  const TetMesh mesh = test::ball_mesh({4, 4, 4}, kOrgan, Vector3::Constant(kOrganM));
  for_each_engine([&](Engine engine) {
    for (const Vector3& at_m : {Vector3(0.06, 0, 0), Vector3(-0.03, 0.05, 0.01)}) {
      Scene scene = before_organ(mesh, 0.08);
      scene.tip_light.emplace();
      scene.tip_light->at_m = at_m;
      // The film alone: what the tissue itself gives back is left out.
      const Picture picture =
          lit_picture(engine, ct, grey_tissue(R"("ambient": 0, "diffuse": 0)"), mesh, scene);
      Eigen::Vector2d shown = Eigen::Vector2d::Zero();
      double weight = 0;
      for (int y = 0; y < 96; ++y) {
        for (int x = 0; x < 96; ++x) {
          const double light = light_of(picture, x, y);
          shown += light * Eigen::Vector2d(2 * (x + 0.5) / 96 - 1, 1 - 2 * (y + 0.5) / 96);
          weight += light;
        }
      }
      ASSERT_GT(weight, 0.3);
      shown /= weight;
      // The film lies where the ball becomes opaque. Eye and light are before it, so that the halves
      // converge.
      const Vector3 middle_m(0, 0, -0.08);
      constexpr double kFilmM = 0.0143;
      Vector3 normal(0, 0, 1);
      for (int step = 0; step < 100; ++step) {
        const Vector3 place_m = middle_m + kFilmM * normal;
        normal = ((at_m - place_m).normalized() - place_m.normalized()).normalized();
      }
      const Vector3 place_m = middle_m + kFilmM * normal;
      const Eigen::Vector2d expected =
          (place_m.head<2>() / -place_m.z()).cwiseQuotient(scene.camera.half_extent);
      EXPECT_LT((shown - expected).norm(), 0.04) << shown.transpose() << " for " << expected.transpose();
      EXPECT_GT(expected.norm(), 0.1);
    }
  });
}

TEST(TipLighting, TheFilmsMicrofacetsCoverItOnce) {
  // The integral of D cos over the half space is 1; W holds D, and straight on all else of it is known.
  for (const double roughness : {0.25, 0.5, 0.9}) {
    double covered = 0;
    constexpr int kSteps = 200'000;
    for (int step = 0; step < kSteps; ++step) {
      const double cosine = (step + 0.5) / kSteps, sine = std::sqrt(1 - cosine * cosine);
      const Vector3 half(sine, 0, cosine);
      // Light and eye are both towards the half vector: n.l is the cosine, F is F0.
      const double film = wet_highlight(Vector3::UnitZ(), half, half, roughness);
      covered += 4 * film / (std::numbers::pi * kWaterReflectance) * 2 * std::numbers::pi / kSteps;
    }
    EXPECT_NEAR(covered, 1, 1e-3) << roughness;
  }
}

TEST(TipLighting, TheFilmMirrorsMoreAtGrazingAnglesAndNothingFromBehind) {
  const Vector3 up = Vector3::UnitZ(), steep = Vector3(0.1, 0, 1).normalized(),
                flat = Vector3(1, 0, 0.15).normalized();
  const auto mirrored = [&](const Vector3& light) {
    return wet_highlight(up, light, Vector3(-light.x(), -light.y(), light.z()), 0.5) / light.z();
  };
  EXPECT_GT(mirrored(flat), 10 * mirrored(steep));
  EXPECT_EQ(wet_highlight(up, -up, up, 0.25), 0);
  // The same there and back.
  EXPECT_NEAR(wet_highlight(up, steep, flat, 0.4) / steep.z(), wet_highlight(up, flat, steep, 0.4) / flat.z(),
              1e-12);
  // The smoother, the brighter in the middle and the darker beside it.
  EXPECT_GT(wet_highlight(up, up, up, 0.25), 2 * wet_highlight(up, up, up, 0.5));
  const Vector3 beside = Vector3(0.9, 0, 1).normalized();
  EXPECT_LT(wet_highlight(up, beside, up, 0.25), wet_highlight(up, beside, up, 0.5));
}

TEST(TipLighting, ARoundPictureIsBlackBeyondItsDiscAndTheSameWithin) {
  Picture picture(120, 80);
  std::ranges::fill(picture.rgb, 200);
  blacken_beyond_disc(picture);
  EXPECT_EQ(picture.pixel(60, 40)[0], 200);
  EXPECT_EQ(picture.pixel(60 + 38, 40)[2], 200);
  EXPECT_EQ(picture.pixel(60 + 41, 40)[0], 0);
  EXPECT_EQ(picture.pixel(0, 0)[1], 0);
  EXPECT_EQ(picture.pixel(119, 79)[1], 0);
  for (int y = 0; y < 80; ++y) {
    for (int x = 0; x < 120; ++x) {
      const bool is_black = picture.pixel(x, y)[1] == 0;
      EXPECT_TRUE(is_black || !is_beyond_disc(120, 80, x, y)) << x << ',' << y;
    }
  }
}

TEST(TipLighting, RefusesALightAndALensThatAreNone) {
  const auto ct =
      ct_of(test::volume_of({48, 48, 48}, 1e-3, Vector3::Zero(), [](const Vector3&) { return 50; }));
  const TetMesh mesh = test::ball_mesh({2, 2, 2}, kOrgan, Vector3::Constant(kOrganM));
  VolumeRenderer renderer(ct, find_transfer_function("liver"), {GpuUse::kOff, Engine::kProcessor});
  renderer.set_mesh(mesh);
  const auto refusal = [&](const Scene& scene) -> std::string {
    try {
      renderer.render({}, scene);
    } catch (const UsageError& error) {
      return error.what();
    }
    return "drawn";
  };
  Scene sound = before_organ(mesh, 0.08);
  sound.tip_light.emplace();
  EXPECT_EQ(refusal(sound), "drawn");
  const double none = std::numeric_limits<double>::quiet_NaN();
  for (const double distance_m : {0.0, -0.1, none, std::numeric_limits<double>::infinity()}) {
    Scene scene = sound;
    scene.tip_light->working_distance_m = distance_m;
    EXPECT_THAT(refusal(scene), HasSubstr("working distance greater than 0")) << distance_m;
  }
  Scene scene = sound;
  scene.tip_light->at_m.x() = none;
  EXPECT_THAT(refusal(scene), HasSubstr("must have a place"));
  for (const auto& [wet, roughness] :
       {std::pair{-0.1, 0.3}, {1.1, 0.3}, {none, 0.3}, {1.0, 0.0}, {1.0, 1.1}}) {
    scene = sound;
    scene.tip_light->wet = wet;
    scene.tip_light->roughness = roughness;
    EXPECT_THAT(refusal(scene), HasSubstr("wet from 0 to 1")) << wet << ' ' << roughness;
  }
  LensCalibration lens;
  lens.width = lens.height = 96;
  lens.focal_px.setConstant(90);
  lens.middle_px.setConstant(47.5);
  scene = sound;
  scene.lens = std::make_shared<const LensRays>(Lens(lens), 96, 96);
  EXPECT_EQ(refusal(scene), "drawn");
  scene.width = 97;
  EXPECT_THAT(refusal(scene), HasSubstr("96x96 pixels, not of one of 97x96"));
  scene.width = 96;
  scene.camera.parallel = true;
  EXPECT_THAT(refusal(scene), HasSubstr("no parallel rays"));
}

}  // namespace
}  // namespace kiroku::sim
