#include "sim/fem/rigid_motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/fem/elastic_body.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using test::tet_grid;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class FreeRigidMotions : public testing::Test {
 protected:
  void hold(std::size_t node) { constraints_.prescribe(node, Vector3::Zero(), "test"); }
  void hold(std::size_t node, std::size_t component) { constraints_.prescribe(node, component, 0, "test"); }
  [[nodiscard]] std::vector<std::string> found() const {
    return free_rigid_motions(mesh_, faces_of(mesh_), constraints_);
  }

  TetMesh mesh_ = tet_grid({1, 1, 1}, {1, 1, 1});  // node i + 2 j + 4 k at (i, j, k)
  Constraints constraints_{8};
};

TEST_F(FreeRigidMotions, AreSixWithoutConstraints) {
  EXPECT_THAT(found(), ElementsAre("the body can move along x, y and z and turn about x, y and z"));
}

TEST_F(FreeRigidMotions, AreThreeTurnsAboutOneNode) {
  hold(0);
  EXPECT_THAT(found(), ElementsAre("the body can turn about x, y and z"));
}

TEST_F(FreeRigidMotions, AreATurnAboutTheLineOfTwoNodes) {
  hold(0);
  hold(2);
  EXPECT_THAT(found(), ElementsAre("the body can turn about y"));
}

TEST_F(FreeRigidMotions, NameDirectionsThatAreNoAxes) {
  hold(0);
  hold(3);
  EXPECT_THAT(found(),
              testing::AnyOf(ElementsAre("the body can turn about the direction (0.71, 0.71, 0)"),
                             ElementsAre("the body can turn about the direction (-0.71, -0.71, 0)")));
}

TEST_F(FreeRigidMotions, AreThoseOfAPlane) {
  for (std::size_t node = 0; node < 4; ++node) hold(node, 2);
  EXPECT_THAT(found(), ElementsAre("the body can move along x and y and turn about z"));
}

TEST_F(FreeRigidMotions, AreNoneForThreeNodesOffALine) {
  hold(0);
  hold(1);
  hold(2);
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(FreeRigidMotions, AreNoneForSixComponentsWellChosen) {
  hold(0);
  hold(1, 1);
  hold(1, 2);
  hold(2, 2);
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(FreeRigidMotions, NameThePieceThatIsNotHeld) {
  const TetMesh other = tet_grid({1, 1, 1}, {1, 1, 1});
  for (const Vector3& node : other.nodes) mesh_.nodes.emplace_back(node + Vector3(5, 0, 0));
  for (Tetrahedron corners : other.tetrahedra) {
    for (std::uint32_t& node : corners) node += 8;
    mesh_.tetrahedra.push_back(corners);
    mesh_.regions.push_back(0);
  }
  constraints_ = Constraints(16);
  for (const std::size_t node : {0U, 1U, 2U, 8U, 9U}) hold(node);
  EXPECT_THAT(found(), ElementsAre("the part of 6 tetrahedra with node 8 can turn about x"));
  hold(10);
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(FreeRigidMotions, FindPartsThatTurnAboutAHinge) {
  // A tetrahedron that shares the edge between nodes 0 and 4 (along z) only.
  mesh_.nodes.emplace_back(-1, 0, 0);
  mesh_.nodes.emplace_back(0, -1, 0);
  mesh_.tetrahedra.push_back({0, 4, 8, 9});
  mesh_.regions.push_back(0);
  constraints_ = Constraints(10);
  for (std::size_t node = 0; node < 8; ++node) hold(node);
  EXPECT_THAT(found(), ElementsAre("the part of 1 tetrahedron with node 0 can turn about z"));
  hold(8);
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(FreeRigidMotions, AreToldByTheBodyThatRefuses) {
  const auto refusal = [&] {
    try {
      const ElasticBody body(mesh_, {{0, {1e3, 0.3}}}, constraints_);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(refusal(),
              HasSubstr("nothing is fixed: the body can move along x, y and z and turn about x, y and z"));
  hold(0);
  EXPECT_THAT(
      refusal(),
      HasSubstr("the displacements that are fixed do not hold it: the body can turn about x, y and z"));
}

}  // namespace
}  // namespace kiroku::sim
