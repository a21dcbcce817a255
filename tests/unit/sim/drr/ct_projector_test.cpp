#include "sim/drr/ct_projector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/unit/sim/drr/drr_test_volume.h"

namespace kiroku::sim {
namespace {

using test::greatest;
using test::largest_difference;
using test::small_geometry;
using test::smooth_body_hu;
using test::volume_of;
using testing::HasSubstr;

/// The part of a voxel that is in an ellipsoid decides its HU, so that the volume is right.
Volume ellipsoid(const Vector3& radii, const Vector3& centre) {
  constexpr double kSpacing = 0.0005;
  const auto within = [&](const Vector3& at) { return (at - centre).cwiseQuotient(radii).norm(); };
  return volume_of(152, kSpacing, [&](const Vector3& at) {
    if (within(at) > 1.03) return -1000.0;
    if (within(at) < 0.97) return 40.0;
    constexpr int kParts = 4;
    int inside = 0;
    for (int part = 0; part < kParts * kParts * kParts; ++part) {
      const Vector3 number(part % kParts, part / kParts % kParts, part / kParts / kParts);
      const Vector3 offset = (number + Vector3::Constant(0.5)) / kParts - Vector3::Constant(0.5);
      inside += within(at + kSpacing * offset) <= 1 ? 1 : 0;
    }
    return -1000.0 + 1040.0 * inside / (kParts * kParts * kParts);
  });
}

TEST(CtProjector, AnEllipsoidIsAsItsEquationSays) {
  const Vector3 radii(0.03, 0.02, 0.025), centre(0.004, -0.003, 0.006);
  const Attenuation attenuation(70);
  const CtProjector projector(ellipsoid(radii, centre), attenuation);
  for (const double angle : {0.0, 33.0, 90.0, 135.0, 200.0}) {
    const ProjectionGeometry geometry = small_geometry(angle);
    const ProjectionImage image = projector.project(geometry);
    double most = 0, squares = 0;
    for (std::size_t row = 0; row < geometry.rows(); ++row) {
      for (std::size_t column = 0; column < geometry.columns(); ++column) {
        const SourceRay ray = geometry.ray(double(column), double(row));
        const Vector3 origin = (ray.origin_m - centre).cwiseQuotient(radii);
        const Vector3 direction = ray.direction.cwiseQuotient(radii);
        const double a = direction.squaredNorm(), b = origin.dot(direction), c = origin.squaredNorm() - 1;
        const double chord_m = b * b > a * c ? 2 * std::sqrt(b * b - a * c) / a : 0;
        const double difference =
            double(image.values[row * geometry.columns() + column]) - chord_m * attenuation.per_m(40);
        squares += difference * difference;
        // Where a chord begins, it changes by more than itself within a voxel.
        if (chord_m > 0.02) most = std::max(most, std::abs(difference));
      }
    }
    const double thickest = 0.06 * attenuation.per_m(40);
    EXPECT_LT(most / thickest, 0.005) << angle;
    EXPECT_LT(std::sqrt(squares / double(image.values.size())) / thickest, 0.005) << angle;
    RecordProperty("most_at_" + std::to_string(int(angle)), std::to_string(most / thickest));
  }
}

TEST(CtProjector, AgreesWithFineSamplingOfTheCt) {
  const Volume volume = volume_of(64, 0.0015, smooth_body_hu);
  const Attenuation attenuation(70);
  const CtProjector projector(volume, attenuation);
  for (const double angle : {0.0, 50.0, 90.0}) {
    const ProjectionGeometry geometry = small_geometry(angle);
    const ProjectionImage image = projector.project(geometry);
    for (const auto& [column, row] : {std::pair{64UL, 48UL}, {40UL, 60UL}, {80UL, 30UL}, {20UL, 20UL}}) {
      const SourceRay ray = geometry.ray(double(column), double(row));
      double integral = 0;
      constexpr double kStep = 0.0001;
      for (double t = 0.9; t < 1.1; t += kStep) {
        integral += kStep * attenuation.per_m(sample_hu(volume, ray.origin_m + t * ray.direction));
      }
      EXPECT_NEAR(double(image.values[row * geometry.columns() + column]), integral, 0.002 * greatest(image))
          << angle << " " << column;
    }
  }
}

TEST(CtProjector, OrientationOfTheGridDoesNotMatter) {
  const Volume volume = volume_of(64, 0.0015, smooth_body_hu);
  // The same voxels counted from the opposite corner, columns and slices exchanged.
  Volume turned = volume;
  turned.grid.direction << 0, 0, -1, 0, -1, 0, -1, 0, 0;
  turned.grid.origin_m = -volume.grid.origin_m;
  for (std::size_t k = 0; k < 64; ++k) {
    for (std::size_t j = 0; j < 64; ++j) {
      for (std::size_t i = 0; i < 64; ++i) {
        turned.hu[turned.grid.offset(i, j, k)] = volume.hu[volume.grid.offset(63 - k, 63 - j, 63 - i)];
      }
    }
  }
  const CtProjector one(volume, Attenuation(60)), other(turned, Attenuation(60));
  for (const double angle : {0.0, 20.0, 90.0}) {
    EXPECT_LT(largest_difference(other.project(small_geometry(angle)), one.project(small_geometry(angle))),
              1e-4);
  }
}

TEST(CtProjector, ThreadsDoNotChangeABitAndInstructionSetsHardlyAnything) {
  const Volume volume = volume_of(64, 0.0015, smooth_body_hu);
  const auto project = [&](unsigned threads, InstructionSet set) {
    return CtProjector(volume, Attenuation(70), {threads, set}).project(small_geometry(40));
  };
  const ProjectionImage baseline = project(1, InstructionSet::kBaseline);
  for (const InstructionSet set :
       {InstructionSet::kBaseline, InstructionSet::kAvx2, InstructionSet::kAvx512}) {
    if (ray_kernel(set) == nullptr) continue;
    const ProjectionImage one = project(1, set);
    for (const unsigned threads : {2U, 3U, 7U})
      EXPECT_EQ(project(threads, set).values, one.values) << threads;
    EXPECT_LT(largest_difference(one, baseline), 1e-5);
  }
}

TEST(CtProjector, AirGivesNothing) {
  const CtProjector projector(volume_of(16, 0.002, [](const Vector3&) { return -1000; }), Attenuation(70));
  EXPECT_EQ(greatest(projector.project(small_geometry(10))), 0);
}

TEST(CtProjector, ADetectorMaySeeLessThanTheVolumeOrMore) {
  const CtProjector projector(volume_of(64, 0.0015, smooth_body_hu), Attenuation(70));
  const GantrySetup wide{1, 1.5, Vector3::Zero(), 15, {300, 300}, {0.9, 0.9}};
  GantrySetup narrow = wide;
  narrow.pixels = {31, 1};
  narrow.size_m = {0.093, 0.003};
  const ProjectionImage whole = projector.project(ProjectionGeometry(wide));
  // One row at the middle: pixels are as large, their centres half a pixel off along both.
  const ProjectionImage part = projector.project(ProjectionGeometry(narrow));
  const double expected =
      0.25 * (double(whole.values[149 * 300 + 149]) + double(whole.values[149 * 300 + 150]) +
              double(whole.values[150 * 300 + 149]) + double(whole.values[150 * 300 + 150]));
  EXPECT_NEAR(double(part.values[15]), expected, 0.01 * expected);
  EXPECT_EQ(whole.values.front(), 0);
}

TEST(CtProjector, RefusesASourceInTheVolume) {
  const CtProjector projector(volume_of(64, 0.0015, smooth_body_hu), Attenuation(70));
  const auto refusal = [&](const GantrySetup& setup) -> std::string {
    try {
      static_cast<void>(projector.project(ProjectionGeometry(setup)));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal({0.02, 1.5, Vector3::Zero(), 0, {8, 8}, {0.1, 0.1}}),
              HasSubstr("the source is inside"));
  EXPECT_THAT(refusal({1, 1.5, Vector3(0, 3, 0), 0, {8, 8}, {0.1, 0.1}}), HasSubstr("is behind the source"));
  EXPECT_THAT(refusal({1, 1.01, Vector3::Zero(), 0, {8, 8}, {0.1, 0.1}}),
              HasSubstr("the detector is inside the volume"));
}

}  // namespace
}  // namespace kiroku::sim
