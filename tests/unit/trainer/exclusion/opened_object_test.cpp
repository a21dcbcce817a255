#include "trainer/exclusion/opened_object.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "sim/mesh/mesh_topology.h"
#include "tests/support/tet_grid.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

double volume_m3(const sim::TetMesh& mesh) {
  double sum_m3 = 0;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    EXPECT_GT(sim::signed_volume_m3(mesh, t), 0);
    sum_m3 += sim::signed_volume_m3(mesh, t);
  }
  return sum_m3;
}

/// A block of 10 x 20 x 30 cm; region 2 above the middle of its height.
sim::TetMesh block() {
  sim::TetMesh mesh = test::tet_grid({3, 4, 5}, {0.1, 0.2, 0.3});
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    double middle_m = 0;
    for (const std::uint32_t node : mesh.tetrahedra[t]) middle_m += mesh.nodes[node].z() / 4;
    mesh.regions[t] = middle_m > 0.15 ? 2 : 1;
  }
  return mesh;
}

TEST(OpenedObject, IsWhatLiesOnOneSideOfThePlane) {
  const sim::TetMesh mesh = block();
  // Along an axis, obliquely, and through nodes; the other half is the rest.
  struct Cut {
    Vector3 on_plane_m, away;
  };
  for (const Cut& cut :
       {Cut{{0, 0, 0.1}, {0, 0, 2}}, Cut{{0.05, 0.1, 0.15}, {1, 0.3, -0.7}}, Cut{{0, 0.1, 0}, {0, 1, 0}}}) {
    const OpenedObject kept = open_object(mesh, cut.on_plane_m, cut.away),
                       lost = open_object(mesh, cut.on_plane_m, -cut.away);
    for (const Vector3& node : kept.mesh.nodes) EXPECT_LT((node - cut.on_plane_m).dot(cut.away), 1e-12);
    EXPECT_NEAR(volume_m3(kept.mesh) + volume_m3(lost.mesh), 0.006, 1e-12);
    // Neighbours share their faces: what has one tetrahedron alone lies on the block's sides or on the plane.
    for (const sim::Face& face : sim::faces_of(kept.mesh).surface) {
      const auto all_are = [&](const auto& is_there) {
        return std::ranges::all_of(face.nodes,
                                   [&](std::uint32_t node) { return is_there(kept.mesh.nodes[node]); });
      };
      bool outside = all_are([&](const Vector3& at_m) {
        return std::abs((at_m - cut.on_plane_m).dot(cut.away.normalized())) < 1e-9;
      });
      for (int axis = 0; axis < 3; ++axis) {
        for (const double side_m : {0.0, 0.1 * (axis + 1)})
          outside =
              outside || all_are([&](const Vector3& at_m) { return std::abs(at_m[axis] - side_m) < 1e-9; });
      }
      EXPECT_TRUE(outside);
    }
  }
  EXPECT_NEAR(volume_m3(open_object(mesh, {0, 0, 0.1}, {0, 0, 1}).mesh), 0.002, 1e-12);
  EXPECT_EQ(open_object(mesh, {0, 0, 1}, {0, 0, 1}).mesh.tetrahedra.size(), mesh.tetrahedra.size());
  EXPECT_TRUE(open_object(mesh, {0, 0, -1}, {0, 0, 1}).mesh.tetrahedra.empty());
}

TEST(OpenedObject, HasTheWholesRegionsNumbersAndDisplacements) {
  const sim::TetMesh mesh = block();
  const OpenedObject kept = open_object(mesh, {0.05, 0.1, 0.2}, {0.2, -0.4, 1});
  // What is linear over the body is so over what is left of it.
  const auto number = [](const Vector3& at_m) { return 3 * at_m.x() - at_m.y() + 2 * at_m.z(); };
  std::vector<double> numbers;
  Eigen::VectorXd displacement_m(3 * static_cast<Eigen::Index>(mesh.nodes.size()));
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    numbers.push_back(number(mesh.nodes[node]));
    displacement_m.segment<3>(3 * static_cast<Eigen::Index>(node)) = 0.01 * mesh.nodes[node];
  }
  const std::vector<double> found = kept.numbers(numbers);
  const Eigen::VectorXd moved_m = kept.displacement_m(displacement_m);
  ASSERT_EQ(found.size(), kept.mesh.nodes.size());
  for (std::size_t node = 0; node < found.size(); ++node) {
    const Vector3& at_m = kept.mesh.nodes[node];
    EXPECT_NEAR(found[node], number(at_m), 1e-12);
    EXPECT_LT((moved_m.segment<3>(3 * static_cast<Eigen::Index>(node)) - 0.01 * at_m).norm(), 1e-12);
  }
  for (std::size_t t = 0; t < kept.mesh.tetrahedra.size(); ++t) {
    double middle_m = 0;
    for (const std::uint32_t node : kept.mesh.tetrahedra[t]) middle_m += kept.mesh.nodes[node].z() / 4;
    // Layers of the grid are 6 cm high, so that the middle of its height is within the third.
    if (middle_m < 0.12 || middle_m > 0.18) {
      EXPECT_EQ(kept.mesh.regions[t], middle_m < 0.15 ? 1 : 2);
    }
  }
}

}  // namespace
}  // namespace kiroku::trainer
