// What vertex-preserving cutting is compared with, and the mesh that all are measured against.
#include "tests/bench/cut_baselines.h"

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "sim/cutting/vertex_preserving_cut.h"
#include "sim/mesh/mesh_check.h"
#include "sim/mesh/mesh_topology.h"
#include "tests/bench/cut_scene.h"
#include "tests/support/calculix.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using test::CutScene;

/// Six cells a side of 1 cm; the blade goes down in the middle of the third column, at x = 2.5 cm.
TetMesh cells_of_a_centimetre() { return test::tet_grid({6, 6, 6}, {0.06, 0.06, 0.06}); }

/// From before the body on, as deep as `tip_m` says, to `to_m`.
std::vector<SweepSurface> blade(double tip_m, double to_m, int steps) {
  std::vector<BladePose> path;
  for (int step = 0; step <= steps; ++step) {
    const double y_m = -0.003 + (to_m + 0.003) * step / steps;
    path.push_back({{0.025, y_m, tip_m}, {0.025, y_m, 0.07}});
  }
  return sweep_surfaces(path);
}

std::size_t parts_of(const TetMesh& mesh) { return face_connected_parts(mesh, faces_of(mesh)).count; }

/// Edges of the mesh that a sweep of the path goes through.
std::size_t edges_through(const TetMesh& mesh, const std::vector<SweepSurface>& path) {
  std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const Tetrahedron& corners : mesh.tetrahedra) {
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = i + 1; j < 4; ++j) edges.insert(std::minmax(corners[i], corners[j]));
    }
  }
  std::size_t through = 0;
  for (const auto& [a, b] : edges) {
    for (const SweepSurface& sweep : path) {
      if (sweep.crossing(mesh.nodes[a], mesh.nodes[b]) != 0) ++through;
    }
  }
  return through;
}

TEST(CutBaselines, RemovalLosesTheVolumeOfTheElementsTheBladeMeets) {
  const TetMesh mesh = cells_of_a_centimetre();
  test::RemovingCut cut(mesh);
  double gone_m3 = 0;
  for (const SweepSurface& sweep : blade(-0.01, 0.07, 4)) {
    for (const std::uint32_t t : cut.cut(sweep)) gone_m3 += signed_volume_m3(mesh, t);
  }
  // Each tetrahedron of a cell reaches from its left side to its right one: the whole column has gone.
  EXPECT_NEAR(gone_m3, 0.06 * 0.06 * 0.01, 1e-15);
  EXPECT_NEAR(test::volume_m3(mesh) - test::volume_m3(cut.mesh()), gone_m3, 1e-15);
  EXPECT_EQ(cut.mesh().nodes, mesh.nodes);
  EXPECT_EQ(parts_of(cut.mesh()), 2U);
  EXPECT_EQ(edges_through(cut.mesh(), blade(-0.01, 0.07, 4)), 0U);
}

TEST(CutBaselines, SubdivisionKeepsTheVolumeAndAddsTwoNodesForEachEdgeItParts) {
  const TetMesh mesh = cells_of_a_centimetre();
  const auto path = blade(-0.01, 0.07, 4);
  const std::size_t edges = edges_through(mesh, path);
  ASSERT_GT(edges, 100U);
  test::SubdividingCut cut(mesh);
  for (const SweepSurface& sweep : path) cut.cut(sweep);
  const TetMesh& parted = cut.mesh();
  EXPECT_NEAR(test::volume_m3(parted), test::volume_m3(mesh), 1e-15);
  EXPECT_EQ(parted.nodes.size(), mesh.nodes.size() + 2 * edges);
  EXPECT_EQ(parts_of(parted), 2U);
  EXPECT_EQ(check_mesh(parted).size(), 1U) << "two pieces, and nothing else";
  double face_m2 = 0;  // of both faces of the cut
  for (const Face& face : faces_of(parted).surface) {
    const auto& [a, b, c] = face.nodes;
    if (std::ranges::any_of(
            face.nodes, [&](std::uint32_t node) { return std::abs(parted.nodes[node].x() - 0.025) > 1e-12; }))
      continue;
    face_m2 += (parted.nodes[b] - parted.nodes[a]).cross(parted.nodes[c] - parted.nodes[a]).norm() / 2;
  }
  EXPECT_NEAR(face_m2, 2 * 0.06 * 0.06, 1e-12);
}

TEST(CutBaselines, SubdivisionMakesWorseAnglesThanVertexPreservingCutsAllow) {
  const CutScene scene;
  const TetMesh mesh = scene.uneven({6, 30, 6});
  test::SubdividingCut subdivided(mesh);
  VertexPreservingCut preserved(mesh);
  for (const SweepSurface& sweep : scene.sweeps(30)) {
    subdivided.cut(sweep);
    preserved.cut(sweep);
  }
  EXPECT_LT(test::smallest_dihedral_degrees(subdivided.mesh()), 2);
  EXPECT_GT(test::smallest_dihedral_degrees(preserved.remaining()),
            test::smallest_dihedral_degrees(subdivided.mesh()));
}

TEST(CutBaselines, SplittingAlongFacesKeepsVolumeAndElementsAndGivesEachSideItsNodes) {
  const TetMesh mesh = cells_of_a_centimetre();
  test::FaceSplittingCut cut(mesh);
  for (const SweepSurface& sweep : blade(-0.01, 0.07, 4)) cut.cut(sweep);
  EXPECT_EQ(cut.mesh().tetrahedra.size(), mesh.tetrahedra.size());
  EXPECT_EQ(test::volume_m3(cut.mesh()), test::volume_m3(mesh));
  EXPECT_EQ(parts_of(cut.mesh()), 2U);
  // Each node of the faces between the two sides has become two.
  const std::size_t added = cut.mesh().nodes.size() - mesh.nodes.size();
  EXPECT_GE(added, 7U * 7U);
  EXPECT_LE(added, 2U * 7U * 7U);
  EXPECT_EQ(check_mesh(cut.mesh()).size(), 1U) << "two pieces, and nothing else";
}

TEST(CutBaselines, ACutThatEndsInsideLeavesOnePieceWhateverTheNumberOfItsSteps) {
  const TetMesh mesh = cells_of_a_centimetre();
  test::SubdividingCut once(mesh), often(mesh);
  test::FaceSplittingCut faces(mesh);
  for (const SweepSurface& sweep : blade(0.023, 0.033, 1)) once.cut(sweep);
  for (const SweepSurface& sweep : blade(0.023, 0.033, 7)) {
    often.cut(sweep);
    faces.cut(sweep);
  }
  EXPECT_EQ(once.mesh().nodes.size(), often.mesh().nodes.size());
  EXPECT_NEAR(test::volume_m3(often.mesh()), test::volume_m3(mesh), 1e-15);
  for (const TetMesh* cut : {&once.mesh(), &often.mesh(), &faces.mesh()}) {
    EXPECT_EQ(parts_of(*cut), 1U);
    EXPECT_TRUE(check_mesh(*cut).empty()) << check_mesh(*cut).front().text;
    EXPECT_GT(faces_of(*cut).surface.size(), faces_of(mesh).surface.size() + 20) << "it is open";
  }
}

TEST(CutBaselines, MeasureKnownAngles) {
  TetMesh corner{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2, 3}}, {0}};
  EXPECT_NEAR(test::smallest_dihedral_degrees(corner), 54.7356, 1e-4);
  TetMesh regular{{{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}}, {{0, 2, 1, 3}}, {0}};
  ASSERT_GT(signed_volume_m3(regular, 0), 0);
  EXPECT_NEAR(test::smallest_dihedral_degrees(regular), 70.5288, 1e-4);
}

TEST(CutBaselines, EstimateTheConditionOfAMatrixAsItsEigenvaluesHaveIt) {
  const TetMesh mesh = test::tet_grid({3, 2, 2}, {0.03, 0.03, 0.02});
  const CutScene scene;
  const ElasticBody body(mesh, {{0, scene.tissue}}, scene.held(mesh));
  const std::vector<const Material*> materials(mesh.tetrahedra.size(), &scene.tissue);
  const StiffnessMatrix stiffness(mesh, materials);
  const auto size = static_cast<Eigen::Index>(3 * mesh.nodes.size());
  std::vector<Eigen::Index> unknowns;
  for (Eigen::Index i = 0; i < size; ++i) {
    if (body.free()[static_cast<std::size_t>(i)]) unknowns.push_back(i);
  }
  Eigen::MatrixXd dense(size, size);
  for (Eigen::Index i = 0; i < size; ++i) dense.col(i) = stiffness * Eigen::VectorXd::Unit(size, i);
  const Eigen::MatrixXd inner = dense(unknowns, unknowns);
  const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(inner).eigenvalues();
  const double exact = values[values.size() - 1] / values[0];
  EXPECT_NEAR(test::condition_number(body) / exact, 1, 0.02);
}

TEST(CutBaselines, TheExactlySplitMeshIsOpenOnThePathUpToItsBorder) {
  const CutScene scene;
  const TetMesh mesh = scene.exactly_split({6, 40, 8});
  EXPECT_TRUE(check_mesh(mesh).empty());
  EXPECT_EQ(parts_of(mesh), 1U);
  double on_path_m2 = 0;
  for (const Face& face : faces_of(mesh).surface) {
    const auto& [a, b, c] = face.nodes;
    const Vector3 across = (mesh.nodes[b] - mesh.nodes[a]).cross(mesh.nodes[c] - mesh.nodes[a]);
    const bool on_blade = std::ranges::all_of(face.nodes, [&](std::uint32_t node) {
      return std::abs(scene.blade_normal().dot(mesh.nodes[node] - scene.on_blade(0, 0))) < 1e-9;
    });
    if (on_blade) on_path_m2 += across.norm() / 2;
  }
  const Vector3 along = scene.on_blade(scene.end_y_m, 0) - scene.on_blade(0, 0);
  const Vector3 up = scene.on_blade(0, scene.size_m.z()) - scene.on_blade(0, scene.tip_z_m);
  // But for one of 36 times 5 times 2 triangles: at the inner corner, all of its nodes are on the border.
  EXPECT_NEAR(on_path_m2, 2 * along.cross(up).norm() * (1 - 1.0 / 360), 1e-9);
}

TEST(CutBaselines, TheExactlySplitMeshOpensAsCalculixHasIt) {
  if (!test::has_ccx()) GTEST_SKIP() << "ccx is not installed";
  const CutScene scene;
  test::CalculixCase input;
  input.mesh = scene.exactly_split({6, 40, 8});
  input.materials = {{0, scene.tissue}};
  input.constraints = scene.held(input.mesh);
  const Eigen::VectorXd force_n = scene.pull(input.mesh);
  const ElasticBody body(input.mesh, input.materials, input.constraints);
  const CutScene::Opening ours = scene.opening(input.mesh, body.solve(force_n).displacement_m);
  const CutScene::Opening theirs =
      scene.opening(input.mesh, test::run_calculix(input, force_n).displacement_m);
  ASSERT_GT(*std::ranges::max_element(theirs.gap_m), 1e-3);
  for (std::size_t i = 0; i < ours.gap_m.size(); ++i) EXPECT_NEAR(ours.gap_m[i], theirs.gap_m[i], 1e-8);
}

}  // namespace
}  // namespace kiroku::sim
