#include "sim/render/endoscope.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/render/volume_renderer.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/picture_likeness.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

const Vector3 kSeen = Vector3::Constant(0.024);
constexpr double kSeenM = 0.016;
constexpr double kTan35 = 0.70020753820970971;

TetMesh seen_mesh() { return test::ball_mesh({4, 4, 4}, kSeen, Vector3::Constant(kSeenM)); }
std::shared_ptr<const ShadedVolume> seen_ct() {
  const Volume ct = test::volume_of({48, 48, 48}, 1e-3, Vector3::Zero(), [](const Vector3& at) {
    const Vector3 from = (at - kSeen) / kSeenM;
    return -100 + 160 * std::clamp((kSeenM - 0.002 - (at - kSeen).norm()) / 0.003 + 0.5, 0.0, 1.0) +
           90 * std::max(0.0, std::sin(7 * from.x()) * std::cos(5 * from.y() + 1) + 0.6 * from.z());
  });
  return std::make_shared<const ShadedVolume>(shade(ct, {Vector3::Zero(), Vector3::Constant(0.047)}));
}
Scene seen_scene(const TetMesh& mesh, int width, int height) {
  Scene scene;
  scene.width = width;
  scene.height = height;
  scene.camera = camera_looking_at(ball_around(mesh), {20, 10}, width, height);
  return scene;
}
/// By the formula alone: the way from the axis that is shown for a slope, at focal length 1.
double bent_by(double slope, double k1, double k2) {
  return slope * (1 + k1 * slope * slope + k2 * std::pow(slope, 4));
}

TEST(Endoscope, HasItsTipBeforeTheTissueAndItsFieldAcrossTheDisc) {
  const TetMesh mesh = seen_mesh();
  for (const auto& [width, height] : {std::pair{201, 101}, {101, 161}}) {
    Scene scene = seen_scene(mesh, width, height);
    look_through({0.05, 70, {-0.25, 0.05}, {}}, mesh, {}, scene);
    // The ball's border is where its corners are.
    EXPECT_NEAR((scene.camera.eye_m - kSeen).norm(), kSeenM + 0.05, 0.002);
    EXPECT_DOUBLE_EQ(scene.tip_light->working_distance_m, 0.05);
    EXPECT_TRUE(scene.round);
    ASSERT_TRUE(scene.lens);
    // The middle stays; half a pixel beyond the disc's last is its border.
    EXPECT_LT(scene.lens->slope(width / 2, height / 2).norm(), 1e-12);
    const Eigen::Vector2d border =
        width > height ? scene.lens->slope(width / 2, 0) : scene.lens->slope(0, height / 2);
    const double step = 2 * kTan35 / 101;
    EXPECT_LT(border.norm(), kTan35);
    EXPECT_GT(border.norm(), kTan35 - 1.5 * step);
  }
}

TEST(Endoscope, KeepsItsDistanceFromTissueThatHasMoved) {
  const TetMesh mesh = seen_mesh();
  Scene still = seen_scene(mesh, 64, 64), moved = still;
  const Vector3 towards = still.camera.to_view.row(2).transpose();
  std::vector<double> displacement_m;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    const Vector3 by = 0.3 * towards;  // beyond where the camera was
    displacement_m.insert(displacement_m.end(), by.data(), by.data() + 3);
  }
  look_through({}, mesh, {}, still);
  look_through({}, mesh, displacement_m, moved);
  EXPECT_LT((moved.camera.eye_m - still.camera.eye_m - 0.3 * towards).norm(), 1e-9);
}

TEST(Endoscope, BendsByTheFormula) {
  constexpr int kWidth = 121, kHeight = 91;
  const TetMesh mesh = seen_mesh();
  for (const auto& [k1, k2] : {std::pair{-0.25, 0.05}, {-0.1, 0.0}, {0.1, 0.02}, {0.0, 0.0}}) {
    Scene scene = seen_scene(mesh, kWidth, kHeight);
    look_through({0.08, 70, {k1, k2}, {}}, mesh, {}, scene);
    const double focal = kHeight / 2.0 / bent_by(kTan35, k1, k2);
    for (int y = 0; y < kHeight; y += 5) {
      for (int x = 0; x < kWidth; x += 5) {
        const Eigen::Vector2d slope = scene.lens->slope(x, y),
                              off(x - (kWidth - 1) / 2.0, (kHeight - 1) / 2.0 - y);
        const double radius = slope.norm();
        if (radius == 0) continue;
        EXPECT_NEAR(focal * bent_by(radius, k1, k2) * slope.x() / radius, off.x(), 1e-6);
        EXPECT_NEAR(focal * bent_by(radius, k1, k2) * slope.y() / radius, off.y(), 1e-6);
      }
    }
  }
}

TEST(Endoscope, AStraightEdgeIsBentInThePicture) {
  constexpr int kSide = 161;
  constexpr double kK1 = -0.25, kK2 = 0.05, kEdge = 0.35;  // where a camera without distortion has it
  const TetMesh mesh = seen_mesh();
  for (const Engine engine : {Engine::kOpenGl, Engine::kProcessor}) {
    SCOPED_TRACE(engine == Engine::kOpenGl ? "OpenGL" : "processor");
    Scene scene = seen_scene(mesh, kSide, kSide);
    scene.background = {0, 0, 0};
    look_through({0.05, 70, {kK1, kK2}, {}}, mesh, {}, scene);
    scene.round = false;
    scene.tip_light.reset();
    // A sheet before the tissue, to the right of the edge.
    constexpr double kDepthM = 0.03, kHalfM = 0.04;
    const Vector3 middle_view_m(kEdge * kDepthM + kHalfM, 0, -kDepthM);
    Solid sheet;
    sheet.shape = Box{{kHalfM, kHalfM, 1e-6}};
    sheet.pose.position_m = scene.camera.eye_m + scene.camera.to_view.transpose() * middle_view_m;
    sheet.pose.orientation = Eigen::Quaterniond(Eigen::Matrix3d(scene.camera.to_view.transpose()));
    sheet.colour = {0, 255, 0};
    scene.solids = {sheet};
    VolumeRenderer renderer(seen_ct(), find_transfer_function("liver"), {GpuUse::kOff, engine});
    renderer.set_mesh(mesh);
    const Picture picture = renderer.render({}, scene);
    const double focal = kSide / 2.0 / bent_by(kTan35, kK1, kK2), middle = (kSide - 1) / 2.0;
    double least = 1e9, most = 0;
    for (int y = 0; y < kSide; ++y) {
      int first = 0;
      while (first < kSide && picture.pixel(first, y)[1] < picture.pixel(first, y)[0] + 60) ++first;
      // The place on the edge that this row shows, by halving.
      double low = -2, high = 2;
      for (int step = 0; step < 60; ++step) {
        const double up = (low + high) / 2, radius = std::hypot(kEdge, up);
        (focal * bent_by(radius, kK1, kK2) * up / radius < middle - y ? low : high) = up;
      }
      const double radius = std::hypot(kEdge, low);
      const double expected = middle + focal * bent_by(radius, kK1, kK2) * kEdge / radius;
      EXPECT_NEAR(first - 0.5, expected, 0.51) << "row " << y;
      least = std::min(least, expected);
      most = std::max(most, expected);
    }
    EXPECT_GT(most - least, 4) << "and that is to be seen";
  }
}

TEST(Endoscope, ALensWithoutDistortionIsACamera) {
  const TetMesh mesh = seen_mesh();
  for (const Engine engine : {Engine::kOpenGl, Engine::kProcessor}) {
    SCOPED_TRACE(engine == Engine::kOpenGl ? "OpenGL" : "processor");
    Scene through = seen_scene(mesh, 120, 90);
    look_through({0.03, 70, {0, 0}, {}}, mesh, {}, through);
    through.round = false;
    Scene without = through;
    without.lens.reset();
    without.camera.half_extent = kTan35 * Eigen::Vector2d(120.0 / 90, 1);
    VolumeRenderer renderer(seen_ct(), find_transfer_function("liver"), {GpuUse::kOff, engine});
    renderer.set_mesh(mesh);
    const test::PictureLikeness found =
        test::likeness(renderer.render({}, through), renderer.render({}, without));
    EXPECT_GT(found.ssim, 0.999);
    EXPECT_LT(found.share, 0.005);
  }
}

TEST(Endoscope, TakesALensOfOnesOwn) {
  const TetMesh mesh = seen_mesh();
  LensCalibration lens;
  lens.model = LensModel::kFisheye;
  lens.width = 640;
  lens.height = 480;
  lens.focal_px = {430, 436};
  lens.middle_px = {331.5, 226};
  lens.coefficients = {-0.021, 0.006, -0.004, 0.0007, 0};
  Endoscope endoscope;
  endoscope.calibration = lens;
  Scene scene = seen_scene(mesh, 320, 240);
  look_through(endoscope, mesh, {}, scene);
  EXPECT_FALSE(scene.round);
  // A pixel of this picture is four of the calibration's.
  const Eigen::Vector2d slope = scene.lens->slope(40, 50), plane = Lens(lens).plane_of({80.5, 100.5});
  EXPECT_LT((slope - Eigen::Vector2d(plane.x(), -plane.y())).norm(), 1e-9);
  Scene other = seen_scene(mesh, 320, 320);
  EXPECT_THROW(look_through(endoscope, mesh, {}, other), UsageError);
}

TEST(Endoscope, RefusesWhatIsNone) {
  const TetMesh mesh = seen_mesh();
  const auto refusal = [&](const Endoscope& endoscope, const Vector3& beside_m) -> std::string {
    Scene scene = seen_scene(mesh, 120, 90);
    scene.camera.eye_m += beside_m;
    try {
      look_through(endoscope, mesh, {}, scene);
    } catch (const UsageError& error) {
      return error.what();
    }
    return "taken";
  };
  EXPECT_EQ(refusal({}, Vector3::Zero()), "taken");
  EXPECT_THAT(refusal({}, Vector3(0, 0, 0.05)), HasSubstr("axis meets no tissue: aim at some (--at X,Y,Z)"));
  EXPECT_THAT(refusal({0.08, 70, {-3, 0}, {}}, Vector3::Zero()), HasSubstr("folds back within 70 degrees"));
  EXPECT_THAT(refusal({0.08, 70, {-0.6, 0}, {}}, Vector3::Zero()),
              HasSubstr("not monotone within the picture"));
}

TEST(LensRays, FindsEveryPixelThatLooksBetweenTwoSlopes) {
  const TetMesh mesh = seen_mesh();
  Scene scene = seen_scene(mesh, 101, 77);
  look_through({0.08, 80, {-0.25, 0.05}, {}}, mesh, {}, scene);
  const LensRays& rays = *scene.lens;
  for (double u = -1; u < 1; u += 0.17) {
    for (double v = -1; v < 1; v += 0.13) {
      const Eigen::Vector2d least(u, v), greatest(u + 0.07, v + 0.05);
      const LensRays::Pixels found = rays.pixels_within(least, greatest);
      int inside = 0;
      for (int y = 0; y < 77; ++y) {
        for (int x = 0; x < 101; ++x) {
          const Eigen::Vector2d slope = rays.slope(x, y);
          if ((slope - least).minCoeff() < 0 || (greatest - slope).minCoeff() < 0) continue;
          ++inside;
          EXPECT_TRUE(x >= found.x0 && x < found.x1 && y >= found.y0 && y < found.y1) << x << ',' << y;
        }
      }
      // And not very many more.
      EXPECT_TRUE(inside == 0 || (found.x1 - found.x0) * (found.y1 - found.y0) <= 32 * 32);
    }
  }
}

}  // namespace
}  // namespace kiroku::sim
