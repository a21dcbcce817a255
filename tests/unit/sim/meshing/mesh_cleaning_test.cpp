#include "sim/meshing/mesh_cleaning.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sim/mesh/mesh_check.h"
#include "sim/mesh/mesh_topology.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using test::tet_grid;

std::vector<std::string> faults_left(const TetMesh& mesh) {
  std::vector<std::string> texts;
  for (const MeshFinding& finding : check_mesh(mesh)) texts.push_back(finding.text);
  return texts;
}

double volume_m3(const TetMesh& mesh) {
  double sum = 0;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) sum += signed_volume_m3(mesh, t);
  return sum;
}

/// Both in one, the second moved; nodes at the same place become one.
TetMesh joined(const TetMesh& one, const TetMesh& other, const Vector3& offset_m) {
  TetMesh mesh = one;
  std::vector<std::uint32_t> number;
  for (const Vector3& node : other.nodes) {
    const Vector3 at = node + offset_m;
    const auto same =
        std::ranges::find_if(one.nodes, [&](const Vector3& known) { return (known - at).norm() < 1e-9; });
    if (same != one.nodes.end()) {
      number.push_back(static_cast<std::uint32_t>(same - one.nodes.begin()));
    } else {
      number.push_back(static_cast<std::uint32_t>(mesh.nodes.size()));
      mesh.nodes.push_back(at);
    }
  }
  for (Tetrahedron corners : other.tetrahedra) {
    for (std::uint32_t& node : corners) node = number[node];
    mesh.tetrahedra.push_back(corners);
    mesh.regions.push_back(0);
  }
  return mesh;
}

TEST(MeshCleaning, LeavesASoundMeshAsItIs) {
  TetMesh mesh = tet_grid({3, 2, 2}, {3, 2, 2});
  const TetMesh before = mesh;
  const Cleaned cleaned = clean(mesh, 1);
  EXPECT_EQ(cleaned.islands + cleaned.hinge_tetrahedra + cleaned.split_nodes, 0U);
  EXPECT_EQ(mesh.nodes, before.nodes);
  EXPECT_EQ(mesh.tetrahedra, before.tetrahedra);
}

TEST(MeshCleaning, KeepsTheLargestPiecesAndCountsTheOthers) {
  const TetMesh large = tet_grid({2, 2, 2}, {2, 2, 2}), small = tet_grid({1, 1, 1}, {1, 1, 1});
  TetMesh mesh = joined(joined(small, large, {5, 0, 0}), small, {0, 5, 0});
  TetMesh two = mesh;
  const Cleaned cleaned = clean(mesh, 1);
  EXPECT_EQ(cleaned.islands, 2U);
  EXPECT_EQ(cleaned.island_tetrahedra, 12U);
  EXPECT_NEAR(volume_m3(mesh), 8, 1e-12);
  EXPECT_EQ(mesh.nodes.size(), 27U);
  EXPECT_THAT(faults_left(mesh), testing::IsEmpty());
  EXPECT_EQ(clean(two, 2).islands, 1U);
  EXPECT_NEAR(volume_m3(two), 9, 1e-12);
  EXPECT_EQ(two.nodes[0], Vector3::Zero());  // of the equal ones the first
}

TEST(MeshCleaning, TakesPartsThatTouchInANodeOrAnEdgeForPieces) {
  const TetMesh large = tet_grid({2, 2, 2}, {2, 2, 2}), small = tet_grid({1, 1, 1}, {1, 1, 1});
  for (const Vector3& offset : {Vector3(2, 2, 2), Vector3(2, 2, 0)}) {
    TetMesh mesh = joined(large, small, offset);
    ASSERT_FALSE(faults_left(mesh).empty());
    EXPECT_EQ(clean(mesh, 1).islands, 1U);
    EXPECT_NEAR(volume_m3(mesh), 8, 1e-12);
    EXPECT_THAT(faults_left(mesh), testing::IsEmpty());
  }
}

/// Unit cubes with their least corners there; neighbours share nodes.
TetMesh cubes(const std::vector<Vector3>& corners) {
  const TetMesh cube = tet_grid({1, 1, 1}, {1, 1, 1});
  TetMesh mesh;
  for (const Vector3& corner : corners) mesh = joined(mesh, cube, corner);
  return mesh;
}

TEST(MeshCleaning, SplitsANodeWhereThePieceTouchesItself) {
  // An arch over cubes that touch in one node, (1, 1, 1).
  TetMesh mesh =
      cubes({{0, 0, 0}, {-1, 0, 0}, {-1, 0, 1}, {-1, 0, 2}, {-1, 1, 2}, {0, 1, 2}, {1, 1, 2}, {1, 1, 1}});
  ASSERT_EQ(face_connected_parts(mesh, faces_of(mesh)).count, 1U);
  ASSERT_EQ(faults_left(mesh).size(), 1U);
  const std::size_t nodes = mesh.nodes.size();
  const double before = volume_m3(mesh);
  const Cleaned cleaned = clean(mesh, 1);
  EXPECT_EQ(cleaned.split_nodes, 1U);
  EXPECT_EQ(cleaned.hinge_tetrahedra, 0U);
  EXPECT_EQ(mesh.nodes.size(), nodes + 1);
  EXPECT_NEAR(volume_m3(mesh), before, 1e-12);
  EXPECT_THAT(faults_left(mesh), testing::IsEmpty());
}

TEST(MeshCleaning, RemovesTheSmallerSideOfAnEdge) {
  // The first and the last cube touch in an edge, and hang together by those above them.
  TetMesh mesh = cubes({{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {1, 1, 0}});
  ASSERT_EQ(face_connected_parts(mesh, faces_of(mesh)).count, 1U);
  ASSERT_EQ(faults_left(mesh).at(0).substr(0, 47), "1 edge of the surface has more than two faces: ");
  const Cleaned cleaned = clean(mesh, 1);
  EXPECT_GT(cleaned.hinge_tetrahedra, 0U);
  EXPECT_GT(volume_m3(mesh), 3.5);
  EXPECT_THAT(faults_left(mesh), testing::IsEmpty());
}

}  // namespace
}  // namespace kiroku::sim
