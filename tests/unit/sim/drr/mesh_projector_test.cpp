#include "sim/drr/mesh_projector.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/tet_grid.h"
#include "tests/unit/sim/drr/drr_test_volume.h"

namespace kiroku::sim {
namespace {

using test::greatest;
using test::largest_difference;
using test::small_geometry;
using test::smooth_body_hu;
using test::volume_of;
using test::zncc;
using testing::HasSubstr;

/// A cube of tetrahedra around the origin; inner nodes may be moved about, so that no face is like another.
TetMesh cube(double side_m, std::uint32_t cells, double jitter) {
  TetMesh mesh = test::tet_grid({cells, cells, cells}, Vector3::Constant(side_m));
  std::uint32_t state = 1;
  const auto random = [&] {
    state = state * 1664525U + 1013904223U;
    return double(state >> 8U) / double(1U << 24U) - 0.5;
  };
  for (Vector3& node : mesh.nodes) {
    node -= Vector3::Constant(side_m / 2);
    if (node.cwiseAbs().maxCoeff() < side_m / 2 - 1e-9) {
      node += jitter * side_m / cells * Vector3(random(), random(), random());
    }
  }
  return mesh;
}

std::vector<Vector3> displaced(const TetMesh& mesh, const std::function<Vector3(const Vector3&)>& to) {
  std::vector<Vector3> displacement_m;
  for (const Vector3& node : mesh.nodes) displacement_m.push_back(to(node) - node);
  return displacement_m;
}

/// Of the volume below: half a voxel beyond its faces, where interpolation ends at nothing.
constexpr double kWhole = 0.0975;

class MeshProjectorTest : public testing::Test {
 protected:
  MeshProjectorTest() : volume_(volume_of(64, 0.0015, smooth_body_hu)), ct_(volume_, Attenuation(70)) {}
  Volume volume_;  // of 96 mm
  CtProjector ct_;
};

TEST_F(MeshProjectorTest, AtRestInsideAndOutsideAreTheWholeCt) {
  const MeshProjector projector(ct_, cube(0.05, 5, 0.4));
  const std::vector<Vector3> at_rest(projector.mesh().nodes.size(), Vector3::Zero());
  for (const double angle : {0.0, 45.0, 90.0, 130.0}) {
    const ProjectionGeometry geometry = small_geometry(angle);
    EXPECT_LT(largest_difference(projector.project(geometry, at_rest), ct_.project(geometry)), 1e-6);
  }
}

TEST_F(MeshProjectorTest, ElementsAddUpToTheWholeRay) {
  // The mesh holds all: nothing is left outside, no line between elements.
  for (const double jitter : {0.0, 0.4}) {
    const MeshProjector projector(ct_, cube(kWhole, 6, jitter));
    for (const double angle : {0.0, 27.0, 45.0, 90.0}) {
      const ProjectionImage whole = ct_.project(small_geometry(angle)),
                            outside = projector.outside(small_geometry(angle));
      double most = 0;
      for (const float value : outside.values) most = std::max(most, std::abs(double(value)));
      EXPECT_LT(most / greatest(whole), 3e-3) << angle << " " << jitter;
    }
  }
}

TEST_F(MeshProjectorTest, AMeshMovedAsARigidBodyIsAMovedCt) {
  const MeshProjector projector(ct_, cube(kWhole, 6, 0.4));
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.rotate(Eigen::AngleAxisd(0.35, Vector3(1, -2, 3).normalized()))
      .pretranslate(Vector3(0.004, 0.01, -0.006));
  const std::vector<Vector3> moved =
      displaced(projector.mesh(), [&](const Vector3& node) -> Vector3 { return motion * node; });
  for (const double angle : {0.0, 60.0, 90.0}) {
    const ProjectionGeometry geometry = small_geometry(angle);
    const ProjectionImage expected = ct_.project(geometry.of_moved_patient(motion));
    const ProjectionImage found = projector.inside(geometry, moved);
    EXPECT_LT(largest_difference(found, expected), 2e-3) << angle;
    EXPECT_GT(zncc(found, expected), 0.99999) << angle;
    RecordProperty("difference_at_" + std::to_string(int(angle)),
                   std::to_string(largest_difference(found, expected)));
  }
}

TEST_F(MeshProjectorTest, ASmoothWarpIsTheResampledWarpedCt) {
  const MeshProjector projector(ct_, cube(kWhole, 16, 0.3));
  // Where tissue at x goes; its inverse by iteration.
  const auto shift = [](const Vector3& x) -> Vector3 {
    return 0.006 * Vector3(std::sin(40 * x.y()), std::cos(30 * x.z() + 1), std::sin(35 * x.x() + 0.5)) *
           std::exp(-x.squaredNorm() / (0.022 * 0.022));
  };
  const Volume warped = volume_of(64, 0.0015, [&](const Vector3& y) {
    Vector3 x = y;
    for (int i = 0; i < 30; ++i) x = y - shift(x);
    return sample_hu(volume_, x);
  });
  const CtProjector reference(warped, Attenuation(70));
  const std::vector<Vector3> moved =
      displaced(projector.mesh(), [&](const Vector3& node) -> Vector3 { return node + shift(node); });
  for (const double angle : {0.0, 45.0, 90.0}) {
    const ProjectionGeometry geometry = small_geometry(angle);
    const ProjectionImage found = projector.project(geometry, moved), expected = reference.project(geometry);
    EXPECT_GT(zncc(found, expected), 0.999) << angle;
    EXPECT_LT(largest_difference(found, expected), 0.02) << angle;
    // And the warp can be seen at all.
    EXPECT_GT(largest_difference(ct_.project(geometry), expected), 0.05);
    RecordProperty("zncc_at_" + std::to_string(int(angle)), std::to_string(zncc(found, expected)));
    RecordProperty("difference_at_" + std::to_string(int(angle)),
                   std::to_string(largest_difference(found, expected)));
  }
}

TEST_F(MeshProjectorTest, WhatTheDetectorCountsChangesAsVolumeDoesUnlessMassIsKept) {
  const MeshProjector projector(ct_, cube(0.09, 6, 0.4));
  // From far away, where a metre is as many pixels at every depth.
  const ProjectionGeometry far(GantrySetup{90, 91, Vector3::Zero(), 25, {160, 160}, {0.16, 0.16}});
  const double at_rest =
      test::sum(projector.inside(far, std::vector<Vector3>(projector.mesh().nodes.size(), Vector3::Zero())));
  const Vector3 stretch(1.1, 0.95, 1.2);
  const std::vector<Vector3> stretched =
      displaced(projector.mesh(), [&](const Vector3& node) -> Vector3 { return stretch.cwiseProduct(node); });
  EXPECT_NEAR(test::sum(projector.inside(far, stretched)) / at_rest, stretch.prod(), 0.002);
  EXPECT_NEAR(test::sum(projector.inside(far, stretched, DensityRule::kKeepMass)) / at_rest, 1, 0.002);
}

TEST_F(MeshProjectorTest, RaysInTheFacesBetweenElementsMissNothing) {
  // The middle of the detector is a column and a row of rays; faces of the cube's cells lie in their planes.
  const Volume water =
      volume_of(64, 0.0015, [](const Vector3& at) { return at.cwiseAbs().maxCoeff() < 0.04 ? 0 : -1000; });
  const CtProjector ct(water, Attenuation(70));
  const MeshProjector projector(ct, cube(0.06, 4, 0));
  const ProjectionGeometry geometry(GantrySetup{1, 1.5, Vector3::Zero(), 0, {65, 65}, {0.05, 0.05}});
  const ProjectionImage image =
      projector.inside(geometry, std::vector<Vector3>(projector.mesh().nodes.size(), Vector3::Zero()));
  for (std::size_t row = 0; row < 65; ++row) {
    for (std::size_t column = 0; column < 65; ++column) {
      const double slope = 1 / geometry.ray(double(column), double(row)).direction.y();
      EXPECT_NEAR(double(image.values[row * 65 + column]), 0.06 * slope * Attenuation(70).per_m(0), 1e-4)
          << column << " " << row;
    }
  }
}

TEST_F(MeshProjectorTest, IsTheSameToTheBitOnAnyNumberOfThreads) {
  const std::vector<Vector3> moved = displaced(
      cube(0.09, 6, 0.4), [&](const Vector3& node) -> Vector3 { return node + 0.1 * node.norm() * node; });
  const auto project = [&](unsigned threads, InstructionSet set) {
    const CtProjector ct(volume_, Attenuation(70), {threads, set});
    return MeshProjector(ct, cube(0.09, 6, 0.4)).project(small_geometry(77), moved);
  };
  const ProjectionImage baseline = project(1, InstructionSet::kBaseline);
  for (const InstructionSet set :
       {InstructionSet::kBaseline, InstructionSet::kAvx2, InstructionSet::kAvx512}) {
    if (ray_kernel(set) == nullptr) continue;
    const ProjectionImage one = project(1, set);
    EXPECT_EQ(project(2, set).values, one.values);
    EXPECT_EQ(project(5, set).values, one.values);
    EXPECT_LT(largest_difference(one, baseline), 1e-4);
  }
}

TEST_F(MeshProjectorTest, StaysFiniteWhereElementsAreFlatOrInsideOut) {
  const MeshProjector projector(ct_, cube(0.06, 3, 0.4));
  const ProjectionGeometry geometry = small_geometry(0);
  const std::vector<std::function<Vector3(const Vector3&)>> shapes{
      [](const Vector3&) -> Vector3 { return Vector3::Zero(); },
      [](const Vector3& node) -> Vector3 { return 1e-15 * node; },
      [](const Vector3& node) -> Vector3 {
        return {node.x(), 0, node.z()};
      },
      [](const Vector3& node) -> Vector3 {
        return {node.x(), 1e-7 * node.y(), node.z()};
      },
      [](const Vector3& node) -> Vector3 {
        return {0, node.y(), node.z()};
      },
      [](const Vector3& node) -> Vector3 { return -node; },
      [](const Vector3& node) -> Vector3 {
        return {node.y() * 3, node.x() * node.x() * 20, std::abs(node.z())};
      }};
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    for (const DensityRule rule : {DensityRule::kKeepDensity, DensityRule::kKeepMass}) {
      const ProjectionImage image = projector.inside(geometry, displaced(projector.mesh(), shapes[i]), rule);
      for (const float value : image.values) ASSERT_TRUE(std::isfinite(value) && value >= 0) << i;
    }
  }
}

TEST_F(MeshProjectorTest, RefusesInASentence) {
  const auto refusal = [](const std::function<void()>& act) -> std::string {
    try {
      act();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  TetMesh beside = cube(0.05, 2, 0);
  for (Vector3& node : beside.nodes) node.x() += 0.03;
  EXPECT_THAT(refusal([&] { MeshProjector(ct_, beside); }),
              HasSubstr("the mesh lies outside the volume: 9 of its nodes do"));
  TetMesh flat = cube(0.05, 1, 0);
  flat.nodes[1] = flat.nodes[0];
  EXPECT_THAT(refusal([&] { MeshProjector(ct_, flat); }), HasSubstr("has no volume"));
  const MeshProjector projector(ct_, cube(0.05, 2, 0));
  std::vector<Vector3> moved(26, Vector3::Zero());
  EXPECT_THAT(refusal([&] { static_cast<void>(projector.inside(small_geometry(0), moved)); }),
              HasSubstr("displacements of 26 nodes; the mesh has 27"));
  moved.emplace_back(0, std::numeric_limits<double>::quiet_NaN(), 0);
  EXPECT_THAT(refusal([&] { static_cast<void>(projector.inside(small_geometry(0), moved)); }),
              HasSubstr("the displacement of node 26 is no number or takes it out of the room"));
  moved.back() = {0, 1e300, 0};
  EXPECT_THAT(refusal([&] { static_cast<void>(projector.inside(small_geometry(0), moved)); }),
              HasSubstr("out of the room"));
  moved.back() = {0, -1.2, 0};
  EXPECT_THAT(refusal([&] { static_cast<void>(projector.inside(small_geometry(0), moved)); }),
              HasSubstr("the source is inside the deformed mesh"));
}

}  // namespace
}  // namespace kiroku::sim
