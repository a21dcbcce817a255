#include "sim/meshing/mesh_quality.h"

#include <numbers>

#include <gtest/gtest.h>

#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

TetMesh one(const std::vector<Vector3>& nodes) { return {nodes, {{0, 1, 2, 3}}, {4}}; }

TEST(MeshQuality, MeasuresARegularTetrahedron) {
  const MeshQuality quality = measure_quality(one({{1, 1, 1}, {1, -1, -1}, {-1, -1, 1}, {-1, 1, -1}}));
  const double regular_deg = std::acos(1.0 / 3) * 180 / std::numbers::pi;
  EXPECT_NEAR(quality.least_dihedral_deg, regular_deg, 1e-10);
  EXPECT_NEAR(quality.greatest_dihedral_deg, regular_deg, 1e-10);
  EXPECT_NEAR(quality.greatest_radius_edge, std::sqrt(6.0) / 4, 1e-12);
  EXPECT_NEAR(quality.volume_m3, 8.0 / 3, 1e-12);
  EXPECT_EQ(quality.regions.at(4).tetrahedra, 1U);
}

TEST(MeshQuality, MeasuresTheCornerOfACube) {
  const MeshQuality quality = measure_quality(one({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}));
  EXPECT_NEAR(quality.greatest_dihedral_deg, 90, 1e-10);
  EXPECT_NEAR(quality.least_dihedral_deg, std::atan(std::sqrt(2.0)) * 180 / std::numbers::pi, 1e-10);
  EXPECT_NEAR(quality.greatest_radius_edge, std::sqrt(3.0) / 2, 1e-12);
}

TEST(MeshQuality, CountsSlivers) {
  // Four points near a circle: two opposite edges, one lifted by h, meet at atan(2 h) twice over.
  const double lift = std::tan(5 * std::numbers::pi / 180) / 2;
  const TetMesh mesh = one({{-1, 0, 0}, {1, 0, 0}, {0, -1, 2 * lift}, {0, 1, 2 * lift}});
  TetMesh turned = mesh;
  if (signed_volume_m3(mesh, 0) < 0) std::swap(turned.tetrahedra[0][2], turned.tetrahedra[0][3]);
  const MeshQuality quality = measure_quality(turned);
  EXPECT_LT(quality.least_dihedral_deg, 12);
  EXPECT_EQ(quality.below_12_deg, 1U);
  EXPECT_GT(quality.greatest_dihedral_deg, 150);
}

TEST(MeshQuality, AddsUpByRegion) {
  TetMesh mesh = test::tet_grid({2, 2, 2}, {1, 2, 3});
  for (std::size_t t = 0; t < mesh.regions.size(); ++t) mesh.regions[t] = t < 6 ? 1 : 2;
  const MeshQuality quality = measure_quality(mesh);
  EXPECT_NEAR(quality.regions.at(1).volume_m3, 6.0 / 8, 1e-12);
  EXPECT_EQ(quality.regions.at(2).tetrahedra, 42U);
  EXPECT_NEAR(quality.volume_m3, 6, 1e-12);
}

}  // namespace
}  // namespace kiroku::sim
