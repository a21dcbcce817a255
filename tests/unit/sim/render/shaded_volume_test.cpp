#include "sim/render/shaded_volume.h"

#include <numbers>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/render/transfer_function.h"
#include "tests/support/ball_mesh.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

const Extent kAll{Vector3::Zero(), Vector3::Constant(0.03)};

/// Of a texel; a whole CT's voxel is one texel further, behind the layer of air.
Vector3 gradient(const ShadedVolume& shaded, std::size_t i, std::size_t j, std::size_t k) {
  const std::uint16_t* texel = shaded.texels.data() + 4 * (i + shaded.size[0] * (j + shaded.size[1] * k));
  return (Vector3(texel[0], texel[1], texel[2]) - Vector3::Constant(32768)) * kGreatestGradientHuPerMm /
         32767;
}
double hu(const ShadedVolume& shaded, std::size_t i, std::size_t j, std::size_t k) {
  return kLeastHu + shaded.texels[4 * (i + shaded.size[0] * (j + shaded.size[1] * k)) + 3] *
                        double{kGreatestHu - kLeastHu} / 65535;
}

TEST(ShadedVolume, HasTheGradientOfALinearCtAlongThePatientsAxes) {
  Volume volume = test::volume_of({16, 16, 16}, 2e-3, Vector3::Zero(), [](const Vector3&) { return 0; });
  // Oblique, with voxels of three sizes: HU rise by 3, -2 and 5 a mm along the patient's axes.
  volume.grid.spacing_m = {1e-3, 2e-3, 3e-3};
  volume.grid.direction = Eigen::AngleAxisd(0.7, Vector3(1, 2, 3).normalized()).toRotationMatrix();
  const Vector3 slope(3, -2, 5);
  for (std::size_t k = 0; k < 16; ++k) {
    for (std::size_t j = 0; j < 16; ++j) {
      for (std::size_t i = 0; i < 16; ++i)
        volume.hu[volume.grid.offset(i, j, k)] =
            static_cast<float>(slope.dot(volume.grid.patient_m({double(i), double(j), double(k)})) * 1000);
    }
  }
  const ShadedVolume shaded = shade(volume, {Vector3::Constant(-1), Vector3::Constant(1)});
  ASSERT_EQ(shaded.size[0], volume.grid.size[0] + 2);
  // Smoothing leaves what is linear as it is, away from the border.
  EXPECT_LT((gradient(shaded, 9, 9, 9) - slope).norm(), 0.05);
  EXPECT_NEAR(hu(shaded, 8, 9, 10), volume.hu[volume.grid.offset(7, 8, 9)], 0.04);
  EXPECT_EQ(shaded.spacing_m, 1e-3);
  EXPECT_NEAR(hu(shaded, 0, 9, 9), kAirHu, 0.04);
  EXPECT_EQ(gradient(shaded, 17, 9, 9), Vector3::Zero());
}

TEST(ShadedVolume, KeepsWhatTheBoxHoldsAndFindsItAgain) {
  const Volume volume = test::volume_of({60, 50, 40}, 1e-3, {0.1, 0.2, -0.3}, [](const Vector3& at) {
    return 1000 * at.x() + 100 * at.y() - 10 * at.z();
  });
  const ShadedVolume shaded = shade(volume, {{0.12, 0.21, -0.28}, {0.13, 0.23, -0.27}});
  EXPECT_LT(shaded.size[0], 22U);
  const Vector3 place(0.125, 0.222, -0.275);
  const Vector3 at = shaded.texture_of(place);
  std::array<std::size_t, 3> voxel{};
  for (int axis = 0; axis < 3; ++axis) {
    const double index = at[axis] * double(shaded.size[static_cast<std::size_t>(axis)]) - 0.5;
    EXPECT_NEAR(index, std::round(index), 1e-9);
    voxel[static_cast<std::size_t>(axis)] = static_cast<std::size_t>(std::lround(index));
  }
  EXPECT_NEAR(hu(shaded, voxel[0], voxel[1], voxel[2]), sample_hu(volume, place), 0.04);
}

TEST(ShadedVolume, KnowsTheRangeOfATetrahedron) {
  Volume volume = test::volume_of({32, 32, 32}, 1e-3, Vector3::Zero(), [](const Vector3&) { return 50; });
  volume.hu[volume.grid.offset(10, 10, 10)] = 700;
  const ShadedVolume shaded = shade(volume, kAll);
  const auto around = [&](double at_m) {
    return hu_range(
        shaded, std::array<Vector3, 4>{Vector3::Constant(at_m), Vector3(at_m + 1e-3, at_m, at_m),
                                       Vector3(at_m, at_m + 1e-3, at_m), Vector3(at_m, at_m, at_m + 1e-3)});
  };
  EXPECT_EQ(around(0.0095)[1], 700);
  EXPECT_EQ(around(0.0095)[0], 50);
  EXPECT_EQ(around(0.022)[1], 50);
  EXPECT_EQ(around(-0.01)[0], kAirHu) << "outside is air";
}

TEST(ShadedVolume, SmoothsTheHuWhereItIsAskedTo) {
  Volume volume = test::volume_of({32, 32, 32}, 1e-3, Vector3::Zero(), [](const Vector3&) { return 0; });
  volume.hu[volume.grid.offset(16, 16, 16)] = 1000;
  EXPECT_NEAR(hu(shade(volume, kAll), 17, 17, 17), 1000, 0.1);
  const ShadedVolume shaded = shade(volume, kAll, {1e-3, 2e-3});
  // The peak of a Gaussian of 2 voxels in space.
  EXPECT_NEAR(hu(shaded, 17, 17, 17), 1000 / std::pow(2 * std::numbers::pi * 4, 1.5), 0.4);
  EXPECT_NEAR(hu(shaded, 15, 17, 17), hu(shaded, 17, 19, 17), 0.1);
}

TEST(ShadedVolume, RefusesAMeshOutsideItsCt) {
  const Volume volume =
      test::volume_of({32, 32, 32}, 1e-3, Vector3::Zero(), [](const Vector3&) { return 0; });
  try {
    shade(volume, {Vector3::Constant(20), Vector3::Constant(30)});
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("outside its CT"));
    EXPECT_THAT(error.what(), HasSubstr("(2e+04, 2e+04, 2e+04)"));
    EXPECT_THAT(error.what(), HasSubstr("--length-unit"));
  }
}

}  // namespace
}  // namespace kiroku::sim
