#include "sim/drr/gl_projector.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/render/ct_mesh.h"
#include "tests/support/ball_mesh.h"

namespace kiroku::sim {
namespace {

const Vector3 kMiddleOfBall = Vector3::Constant(0.032);
constexpr double kRadiusOfBall = 0.024;

/// Tissue with something different on each side of it; air at the border.
Volume ct() {
  return test::volume_of({64, 64, 64}, 1e-3, Vector3::Zero(), [](const Vector3& at) {
    const Vector3 from = (at - kMiddleOfBall) / kRadiusOfBall;
    const double tissue = 40 + 200 * std::sin(6 * from.x()) * std::cos(5 * from.y() + 1) + 300 * from.z();
    return from.norm() < 1.1 ? tissue : -1000;
  });
}
TetMesh projected_ball() {
  return test::ball_mesh({6, 6, 6}, kMiddleOfBall, Vector3::Constant(kRadiusOfBall));
}

ProjectionGeometry view(double gantry_deg) {
  GantrySetup setup;
  setup.isocenter_m = kMiddleOfBall;
  setup.gantry_deg = gantry_deg;
  setup.pixels = {96, 80};
  setup.size_m = {0.096, 0.080};
  return ProjectionGeometry(setup);
}

std::vector<Vector3> displacement(const TetMesh& mesh, bool bent) {
  std::vector<Vector3> all;
  for (const Vector3& node : mesh.nodes) {
    const Vector3 from = (node - kMiddleOfBall) / kRadiusOfBall;
    const Vector3 by(0.15 * from.z() * from.z(), -0.1 * from.x(), 0.2 * from.y());
    all.push_back(bent ? Vector3(kRadiusOfBall * by) : Vector3::Zero());
  }
  return all;
}

/// Zero-mean normalised cross-correlation.
double zncc(const ProjectionImage& a, const ProjectionImage& b) {
  const auto count = double(a.values.size());
  double mean_a = 0, mean_b = 0, aa = 0, bb = 0, ab = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    mean_a += double{a.values[i]} / count;
    mean_b += double{b.values[i]} / count;
  }
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    const double da = double{a.values[i]} - mean_a, db = double{b.values[i]} - mean_b;
    aa += da * da;
    bb += db * db;
    ab += da * db;
  }
  return ab / std::sqrt(aa * bb);
}
double sum(const ProjectionImage& image) {
  double all = 0;
  for (const float value : image.values) all += double{value};
  return all;
}

void expect_alike(const ProjectionImage& one, const ProjectionImage& other) {
  ASSERT_EQ(one.values.size(), other.values.size());
  EXPECT_GT(zncc(one, other), 0.9995);
  EXPECT_NEAR(sum(one) / sum(other), 1, 2e-3);
}

TEST(GlProjector, AgreesWithTheProjectorOnTheProcessor) {
  const Volume volume = ct();
  const Attenuation attenuation(60);
  const CtProjector plain(volume, attenuation);
  const MeshProjector processor(plain, projected_ball());
  GlProjector projector(volume, attenuation, projected_ball(), GpuUse::kOff);
  for (const double gantry_deg : {0.0, 90.0, 215.0}) {
    for (const bool bent : {false, true}) {
      const std::vector<Vector3> moved = displacement(projected_ball(), bent);
      for (const DensityRule rule : {DensityRule::kKeepDensity, DensityRule::kKeepMass}) {
        SCOPED_TRACE(gantry_deg);
        expect_alike(projector.inside(view(gantry_deg), moved, rule),
                     processor.inside(view(gantry_deg), moved, rule));
      }
    }
  }
}

TEST(GlProjector, AgreesWithAPlainRayIntegralWhereNothingIsDeformed) {
  const Volume volume = ct();
  const Attenuation attenuation(60);
  const TetMesh box = mesh_of(volume.grid);
  GlProjector projector(volume, attenuation, box, GpuUse::kOff);
  const ProjectionImage image =
      projector.inside(view(30), std::vector<Vector3>(box.nodes.size(), Vector3::Zero()));
  expect_alike(image, CtProjector(volume, attenuation).project(view(30)));
  // One ray by hand.
  const SourceRay ray = view(30).ray(41, 37);
  double integral = 0;
  constexpr double kStep_m = 1e-4;
  for (double t = 0.8; t < 1.2; t += kStep_m)
    integral += kStep_m * attenuation.per_m(sample_hu(volume, ray.origin_m + t * ray.direction));
  EXPECT_NEAR(image.values[37 * 96 + 41] / integral, 1, 5e-3);
}

TEST(GlProjector, GivesTheSameBitsTwice) {
  GlProjector one(ct(), Attenuation(60), projected_ball(), GpuUse::kOff),
      other(ct(), Attenuation(60), projected_ball(), GpuUse::kOff);
  const std::vector<Vector3> moved = displacement(projected_ball(), true);
  EXPECT_EQ(one.inside(view(10), moved).values, other.inside(view(10), moved).values);
}

TEST(GlProjector, SeesThroughATetrahedronTurnedInsideOutOrFlat) {
  const Volume volume = ct();
  GlProjector projector(volume, Attenuation(60), projected_ball(), GpuUse::kOff);
  const TetMesh mesh = projected_ball();
  std::vector<Vector3> mirrored, flat;
  for (const Vector3& node : mesh.nodes) {
    mirrored.emplace_back(0, 0, 2 * (kMiddleOfBall.z() - node.z()));
    flat.emplace_back(0, 0, kMiddleOfBall.z() - node.z());
  }
  const ProjectionImage image = projector.inside(view(0), mirrored);
  EXPECT_NEAR(sum(image) / sum(projector.inside(view(0), displacement(mesh, false))), 1, 5e-3);
  EXPECT_EQ(sum(projector.inside(view(0), flat)), 0);
}

TEST(GlProjector, RefusesWhatCannotBeProjected) {
  GlProjector projector(ct(), Attenuation(60), projected_ball(), GpuUse::kOff);
  EXPECT_THROW(projector.inside(view(0), std::vector<Vector3>(3)), Error);
  std::vector<Vector3> moved = displacement(projected_ball(), false);
  moved[5].x() = std::nan("");
  EXPECT_THROW(projector.inside(view(0), moved), Error);
  for (Vector3& by : moved) by = {0, -1, 0};
  try {
    projector.inside(view(0), moved);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("source would be inside"));
  }
}

}  // namespace
}  // namespace kiroku::sim
