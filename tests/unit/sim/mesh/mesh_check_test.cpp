#include "sim/mesh/mesh_check.h"

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sim/mesh/mesh_topology.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using test::tet_grid;
using testing::ElementsAre;
using testing::IsEmpty;

std::vector<std::string> sentences_of_faults(const TetMesh& mesh) {
  std::vector<std::string> texts;
  for (const MeshFinding& finding : check_mesh(mesh)) texts.push_back(finding.text);
  return texts;
}

/// The unit tetrahedron at the origin, and more of them.
TetMesh corner_mesh(std::vector<Vector3> more_nodes = {}, std::vector<Tetrahedron> more = {}) {
  TetMesh mesh;
  mesh.nodes = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.nodes.insert(mesh.nodes.end(), more_nodes.begin(), more_nodes.end());
  mesh.tetrahedra = {{0, 1, 2, 3}};
  mesh.tetrahedra.insert(mesh.tetrahedra.end(), more.begin(), more.end());
  mesh.regions.assign(mesh.tetrahedra.size(), 0);
  return mesh;
}

TEST(MeshCheck, FindsNothingInASoundMesh) {
  EXPECT_THAT(sentences_of_faults(tet_grid({3, 2, 4}, {1, 1, 1})), IsEmpty());
  double volume = 0;
  const TetMesh mesh = tet_grid({3, 2, 4}, {1, 2, 3});
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) volume += signed_volume_m3(mesh, t);
  EXPECT_NEAR(volume, 6, 1e-12);
}

TEST(MeshCheck, NamesInvertedAndFlatTetrahedra) {
  TetMesh mesh = tet_grid({2, 2, 2}, {1, 1, 1});
  std::swap(mesh.tetrahedra[5][0], mesh.tetrahedra[5][1]);
  std::swap(mesh.tetrahedra[17][2], mesh.tetrahedra[17][1]);
  EXPECT_THAT(sentences_of_faults(mesh), ElementsAre("2 tetrahedra are inverted: 5, 17"));
  EXPECT_THAT(sentences_of_faults(corner_mesh({{1, 1, 1e-9}}, {{0, 2, 1, 4}})),
              ElementsAre("1 tetrahedron is flat: 1"));
  EXPECT_THAT(sentences_of_faults(corner_mesh({}, {{0, 1, 1, 3}}))[0], "1 tetrahedron is flat: 1");
}

TEST(MeshCheck, NamesAtMostEight) {
  TetMesh mesh = tet_grid({1, 1, 1}, {1, 1, 1});
  for (int i = 0; i < 10; ++i) mesh.nodes.emplace_back(0, 0, 0);
  EXPECT_THAT(sentences_of_faults(mesh),
              ElementsAre("10 nodes belong to no tetrahedron: 8, 9, 10, 11, 12, 13, 14, 15, ..."));
}

TEST(MeshCheck, NamesPieces) {
  EXPECT_THAT(sentences_of_faults(corner_mesh({{5, 0, 0}, {6, 0, 0}, {5, 1, 0}, {5, 0, 1}}, {{4, 5, 6, 7}})),
              ElementsAre("the mesh is in 2 pieces: 1 tetrahedron with node 0, 1 tetrahedron with node 4"));
}

TEST(MeshCheck, NamesHingesAndOverlaps) {
  EXPECT_THAT(sentences_of_faults(corner_mesh({{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}}, {{0, 4, 6, 5}})),
              ElementsAre("1 node joins tetrahedra that share no face around it: 0"));
  EXPECT_THAT(sentences_of_faults(corner_mesh({{-1, 0, 0}, {0, -1, 0}}, {{0, 3, 4, 5}})),
              ElementsAre("1 edge of the surface has more than two faces: 0-3",
                          "2 nodes join tetrahedra that share no face around them: 0, 3"));
  const std::vector<std::string> crowded =
      sentences_of_faults(corner_mesh({{1, 1, 1}, {2, 2, 2}}, {{1, 2, 3, 4}, {1, 2, 3, 5}}));
  ASSERT_FALSE(crowded.empty());
  EXPECT_EQ(crowded[0], "1 face belongs to more than two tetrahedra: 1-2-3");
}

TEST(MeshTopology, FindsSurfaceAndInnerFaces) {
  const TetMesh mesh = tet_grid({2, 2, 2}, {1, 1, 1});
  const Faces faces = faces_of(mesh);
  EXPECT_EQ(faces.surface.size(), 6U * 4 * 2);
  EXPECT_EQ(faces.between.size(), (4 * mesh.tetrahedra.size() - faces.surface.size()) / 2);
  // Anticlockwise from outside: the enclosed volume is positive and whole.
  double volume = 0;
  for (const Face& face : faces.surface) {
    Eigen::Matrix3d corners;
    for (Eigen::Index i = 0; i < 3; ++i) corners.col(i) = mesh.nodes[face.nodes[static_cast<std::size_t>(i)]];
    volume += corners.determinant() / 6;
  }
  EXPECT_NEAR(volume, 1, 1e-12);
}

TEST(MeshTopology, TellsPartsThatHangTogetherByFacesFromThoseByNodes) {
  const TetMesh hinge = corner_mesh({{-1, 0, 0}, {0, -1, 0}}, {{0, 3, 4, 5}});
  EXPECT_EQ(node_connected_parts(hinge).count, 1U);
  EXPECT_EQ(face_connected_parts(hinge, faces_of(hinge)).count, 2U);
}

}  // namespace
}  // namespace kiroku::sim
