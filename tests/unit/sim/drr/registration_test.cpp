#include "sim/drr/registration.h"

#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/unit/sim/drr/drr_test_volume.h"

namespace kiroku::sim {
namespace {

using test::small_geometry;

TEST(Registration, GradientCorrelationKnowsNoLinearScale) {
  const CtProjector ct(test::volume_of(64, 0.0015, test::smooth_body_hu), Attenuation(70));
  const ProjectionImage image = ct.project(small_geometry(0));
  ProjectionImage scaled = image, inverted = image;
  for (float& value : scaled.values) value = 3 * value + 7;
  for (float& value : inverted.values) value = -value;
  EXPECT_NEAR(gradient_correlation(image, scaled), 1, 1e-5);
  EXPECT_NEAR(gradient_correlation(image, inverted), -1, 1e-9);
  EXPECT_LT(gradient_correlation(image, ct.project(small_geometry(20))), 0.99);
  EXPECT_EQ(gradient_correlation({2, 2, {1, 1, 1, 1}}, {2, 2, {1, 2, 3, 4}}), 0);
  EXPECT_THROW(static_cast<void>(gradient_correlation({2, 2, {1, 1, 1, 1}}, {1, 2, {1, 2}})), Error);
}

TEST(Registration, BinnedPicturesAreWhatFewerPixelsSee) {
  const CtProjector ct(test::volume_of(64, 0.0015, test::smooth_body_hu), Attenuation(70));
  const ProjectionGeometry geometry = small_geometry(30);
  EXPECT_LT(test::largest_difference(binned(ct.project(geometry), 4), ct.project(geometry.binned(4))), 0.02);
}

TEST(Registration, FindsHowThePatientLay) {
  const CtProjector ct(test::volume_of(64, 0.0015, test::smooth_body_hu), Attenuation(70));
  const ProjectionGeometry geometry = small_geometry(20);
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.rotate(Eigen::AngleAxisd(0.07, Vector3(1, 2, -1).normalized()))
      .pretranslate(Vector3(0.005, -0.003, -0.006));
  // A detector's own scale and offset.
  ProjectionImage radiograph = ct.project(geometry.of_moved_patient(motion));
  for (float& value : radiograph.values) value = 30 + 8 * value;
  const Registration found =
      register_rigidly(radiograph, geometry, Vector3::Zero(),
                       [&](const ProjectionGeometry& seen_by) { return ct.project(seen_by); });
  EXPECT_GT(found.similarity_after, 0.99);
  EXPECT_LT(found.similarity_before, 0.9);
  // Where points of the patient are seen, to half a pixel; depth is not.
  double most = 0;
  for (const Vector3& point : {Vector3(0.02, 0, 0), Vector3(0, 0.02, 0.01), Vector3(-0.01, 0.01, -0.02)}) {
    const PixelPoint expected = *geometry.project(motion * point),
                     seen = *geometry.project(found.motion * point);
    most = std::max({most, std::abs(seen.column - expected.column), std::abs(seen.row - expected.row)});
  }
  EXPECT_LT(most, 0.5);
  RecordProperty("pixels_off", std::to_string(most));
  RecordProperty("similarity_before", std::to_string(found.similarity_before));
  RecordProperty("similarity_after", std::to_string(found.similarity_after));
}

TEST(Registration, LeavesAPatientWhoLiesRight) {
  const CtProjector ct(test::volume_of(48, 0.002, test::smooth_body_hu), Attenuation(70));
  const ProjectionGeometry geometry = small_geometry(0);
  const Registration found =
      register_rigidly(ct.project(geometry), geometry, Vector3::Zero(),
                       [&](const ProjectionGeometry& seen_by) { return ct.project(seen_by); });
  EXPECT_NEAR(found.similarity_before, 1, 1e-6);
  EXPECT_GE(found.similarity_after, found.similarity_before);
  EXPECT_LT(found.translation_m.norm(), 0.0005);
  EXPECT_THROW(static_cast<void>(register_rigidly({2, 2, {1, 2, 3, 4}}, geometry, Vector3::Zero(), nullptr)),
               Error);
}

}  // namespace
}  // namespace kiroku::sim
