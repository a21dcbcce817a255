// A lung is brought to a second surface that a known motion has made.
#include "sim/respiration/sliding_boundary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/respiration/landmarks.h"
#include "sim/respiration/mesh_point.h"
#include "tests/unit/sim/respiration/box_lung.h"

namespace kiroku::sim {
namespace {

/// An egg, whose surface says where each of its ends has gone, unlike a box's or a ball's.
struct Egg {
  TetMesh mesh;
  LungSurface surface;
  Materials materials{{1, {1e4, 0.25}}};
  Egg() {
    mesh = test::tet_grid({8, 8, 12}, {2, 2, 2});
    for (Vector3& node : mesh.nodes) {
      const Vector3 p = node - Vector3::Ones();
      // Half-way from the cube's layers to a ball's.
      const Vector3 ball = p.norm() > 0 ? Vector3(p * (1 + p.lpNorm<Eigen::Infinity>() / p.norm()) / 2) : p;
      node = Vector3(0.05 * ball.x() * (1 - 0.3 * ball.z()), 0.07 * ball.y(), 0.11 * ball.z());
    }
    for (std::int32_t& region : mesh.regions) region = 1;
    surface = surface_of(mesh);
  }
};

DistanceField field_of(const Egg& egg, const std::vector<Vector3>& places_m) {
  LabelMap mask;
  mask.grid.size = {80, 90, 140};
  mask.grid.spacing_m = Vector3::Constant(0.002);
  mask.grid.origin_m = Vector3(-0.08, -0.09, -0.14);
  std::vector<std::uint8_t> marked(mask.grid.voxels());
  mark_voxels(places_m, egg.mesh.tetrahedra, mask.grid, marked);
  mask.labels.assign(marked.begin(), marked.end());
  return signed_distance(mask);
}

Vector3 grown(const Vector3& p) {
  return {1.05 * p.x() + 0.001, 1.08 * p.y() - 0.002, 1.06 * p.z() + 0.04 * p.x() - 0.004};
}

struct Met {
  SurfacePoints points;
  Eigen::VectorXd displacement_m;
};

Met meet(const Egg& egg, const SlidingOptions& options = {}) {
  std::vector<Vector3> places;
  for (const Vector3& node : egg.mesh.nodes) places.push_back(grown(node));
  const DistanceField field = field_of(egg, places);
  Met met{points_on(field), {}};
  const Eigen::VectorXd still_m = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * places.size()));
  met.displacement_m = slide_to(egg.mesh, egg.materials, egg.surface, field, met.points,
                                Eigen::Isometry3d::Identity(), still_m, options);
  return met;
}

Spread inner_errors(const Egg& egg, const Eigen::VectorXd& displacement_m) {
  std::vector<double> errors;
  for (std::size_t node = 0; node < egg.mesh.nodes.size(); ++node) {
    if (egg.surface.row_of[node] >= 0) continue;
    const Vector3 moved_m =
        egg.mesh.nodes[node] + displacement_m.segment<3>(static_cast<Eigen::Index>(3 * node));
    errors.push_back((moved_m - grown(egg.mesh.nodes[node])).norm());
  }
  return spread_of(errors);
}

TEST(SlidingBoundary, AGrowthThatIsEvenIsFoundInsideToo) {
  // Grown, sheared and shifted by up to 11 mm; no boundary condition is given but the second mask.
  const Egg egg;
  const Met met = meet(egg);
  const Spread before = inner_errors(egg, Eigen::VectorXd::Zero(met.displacement_m.size()));
  const Spread errors = inner_errors(egg, met.displacement_m);
  RecordProperty("inner_mm", std::to_string(1000 * errors.mean));
  EXPECT_GT(before.mean, 0.003);
  EXPECT_LT(errors.mean, 0.0006);
  EXPECT_LT(errors.greatest, 0.002);
  const auto all = [](const Vector3&) { return true; };
  const Spread left = spread_of(distances_to_lung_m(egg.mesh, egg.surface, met.points,
                                                    Eigen::Isometry3d::Identity(), met.displacement_m, all));
  EXPECT_LT(left.mean, 0.0006);
}

TEST(SlidingBoundary, WhatIsLeftOutOfTheSecondSurfaceIsPredicted) {
  const Egg egg;
  SlidingOptions options;
  options.leave_out = [](const Vector3& place_m) { return place_m.z() > 0 && place_m.x() > 0; };
  const Met met = meet(egg, options);
  const Eigen::VectorXd still_m = Eigen::VectorXd::Zero(met.displacement_m.size());
  const auto left = [&](const Eigen::VectorXd& displacement_m) {
    return spread_of(distances_to_lung_m(egg.mesh, egg.surface, met.points, Eigen::Isometry3d::Identity(),
                                         displacement_m, options.leave_out));
  };
  EXPECT_GT(left(still_m).count, 100U);
  EXPECT_GT(left(still_m).mean, 0.002);
  EXPECT_LT(left(met.displacement_m).mean, 0.001);
}

TEST(SlidingBoundary, PointsLieOnTheSurfaceAndLookOutwards) {
  const Egg egg;
  const DistanceField field = field_of(egg, egg.mesh.nodes);
  const SurfacePoints points = points_on(field);
  EXPECT_GT(points.places_m.size(), 1000U);
  for (std::size_t i = 0; i < points.places_m.size(); ++i) {
    EXPECT_LT(std::abs(sample(field, points.places_m[i]).distance_m), 0.0006);
    EXPECT_NEAR(points.normals[i].norm(), 1, 1e-12);
    EXPECT_GT(sample(field, points.places_m[i] + 0.004 * points.normals[i]).distance_m, 0.001);
    EXPECT_LT(sample(field, points.places_m[i] - 0.004 * points.normals[i]).distance_m, -0.001);
  }
}

TEST(SlidingBoundary, ASurfaceWithoutPointsIsRefused) {
  const Egg egg;
  const DistanceField field = field_of(egg, egg.mesh.nodes);
  EXPECT_THROW(static_cast<void>(
                   slide_to(egg.mesh, egg.materials, egg.surface, field, {}, Eigen::Isometry3d::Identity(),
                            Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * egg.mesh.nodes.size())))),
               Error);
}

}  // namespace
}  // namespace kiroku::sim
