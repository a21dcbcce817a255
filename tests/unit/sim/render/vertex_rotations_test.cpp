#include "sim/render/vertex_rotations.h"

#include <gtest/gtest.h>

#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

std::vector<Vector3> moved(const TetMesh& mesh, const Eigen::Matrix3d& by) {
  std::vector<Vector3> positions;
  for (const Vector3& node : mesh.nodes) positions.push_back(by * node + Vector3(0.1, -2, 3));
  return positions;
}

TEST(VertexRotations, AreThoseOfARigidMotion) {
  const TetMesh mesh = test::tet_grid({3, 2, 2}, {0.3, 0.2, 0.1});
  const VertexRotations rotations(mesh);
  std::vector<Eigen::Quaterniond> found;
  for (const double angle : {0.0, 0.4, 1.5, 3.1}) {
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, Vector3(1, -2, 0.5).normalized()));
    rotations.compute(moved(mesh, turn.toRotationMatrix()), found);
    for (const Eigen::Quaterniond& q : found) EXPECT_LT(q.angularDistance(turn), 1e-6) << angle;
  }
}

TEST(VertexRotations, LeaveStretchOut) {
  const TetMesh mesh = test::tet_grid({3, 3, 3}, {0.3, 0.3, 0.3});
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(1, Vector3(1, 1, -1).normalized()).toRotationMatrix();
  Eigen::Matrix3d stretch = Vector3(1.5, 0.7, 1.1).asDiagonal();
  stretch(0, 1) = stretch(1, 0) = 0.2;
  std::vector<Eigen::Quaterniond> found;
  VertexRotations(mesh).compute(moved(mesh, turn * stretch), found);
  for (const Eigen::Quaterniond& q : found) EXPECT_LT(q.angularDistance(Eigen::Quaterniond(turn)), 1e-6);
}

TEST(VertexRotations, AreFoundForNeighboursInAPlaneAndNoneForLooseNodes) {
  TetMesh mesh = test::tet_grid({1, 1, 1}, {0.1, 0.1, 0.1});
  mesh.nodes.emplace_back(5, 5, 5);
  // Of one tetrahedron, flat as a sheet.
  mesh.nodes.insert(mesh.nodes.end(), {{9, 0, 0}, {9.1, 0, 0}, {9, 0.1, 0}, {9.1, 0.1, 0}});
  const auto first = static_cast<std::uint32_t>(mesh.nodes.size() - 4);
  mesh.tetrahedra.push_back({first, first + 1, first + 2, first + 3});
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.8, Vector3::UnitX()));
  std::vector<Eigen::Quaterniond> found;
  VertexRotations(mesh).compute(moved(mesh, turn.toRotationMatrix()), found);
  EXPECT_LT(found[8].angularDistance(Eigen::Quaterniond::Identity()), 1e-12);
  for (std::size_t node = first; node < mesh.nodes.size(); ++node)
    EXPECT_LT(found[node].angularDistance(turn), 1e-6);
}

TEST(VertexRotations, StayRotationsWhereTissueIsTurnedInsideOut) {
  const TetMesh mesh = test::tet_grid({2, 2, 2}, {0.1, 0.1, 0.1});
  const Eigen::Matrix3d mirror = Vector3(1, 1, -1).asDiagonal();
  for (const Eigen::Matrix3d& by : {mirror, Eigen::Matrix3d(Eigen::Matrix3d::Zero())}) {
    std::vector<Eigen::Quaterniond> found;
    VertexRotations(mesh).compute(moved(mesh, by), found);
    for (const Eigen::Quaterniond& q : found) EXPECT_NEAR(q.norm(), 1, 1e-12);
  }
}

}  // namespace
}  // namespace kiroku::sim
