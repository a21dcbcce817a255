// Nodes that slide along lines and planes that are no axes of the mesh.
#include <random>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/fem/corotational_body.h"
#include "sim/fem/elastic_body.h"
#include "sim/mesh/degrees_of_freedom.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using test::tet_grid;
using testing::HasSubstr;

constexpr double kRoundOff = 1e-9;
const Materials kSlidingTissue{{0, {1e4, 0.25}}};
const Vector3 kSizeM(0.03, 0.02, 0.04);

Eigen::Matrix3d oblique() {
  return Eigen::AngleAxisd(0.7, Vector3(0.3, -1, 0.5).normalized()).toRotationMatrix();
}

TetMesh turned_grid(const Eigen::Matrix3d& turn) {
  TetMesh mesh = tet_grid({3, 2, 4}, kSizeM);
  for (Vector3& node : mesh.nodes) node = turn * node;
  return mesh;
}

/// The lower end slides along its plane and is pushed through it by 1 mm, one corner of it stays, and an edge
/// may only go along its line; all in axes that are turned with the block.
Constraints sliding(const TetMesh& straight, const Eigen::Matrix3d& turn, bool turned) {
  Constraints constraints(straight.nodes.size());
  for (std::size_t node = 0; node < straight.nodes.size(); ++node) {
    const Vector3& place = straight.nodes[node];
    if (place.z() > 0) continue;
    if (turned) constraints.turn(node, turn);
    constraints.prescribe(node, 2, 1e-3, "plane");
    if (place.x() == 0) constraints.prescribe(node, 0, 0, "edge");
    if (place.x() == 0 && place.y() == 0) constraints.prescribe(node, 1, 0, "corner");
  }
  return constraints;
}

Eigen::VectorXd pull(const TetMesh& straight, const Eigen::Matrix3d& turn) {
  Eigen::VectorXd force_n = Eigen::VectorXd::Zero(first_row(straight.nodes.size()));
  std::mt19937 random(3);
  for (std::size_t node = 0; node < straight.nodes.size(); ++node) {
    Vector3 pulled;
    for (Eigen::Index i = 0; i < 3; ++i) pulled[i] = 1e-3 * (double(random()) / 4294967296.0 - 0.5);
    if (straight.nodes[node].z() == kSizeM.z()) force_n.segment<3>(first_row(node)) = turn * pulled;
  }
  return force_n;
}

TEST(Sliding, ATurnedBodySlidesAsTheBodyThatIsNotTurned) {
  const TetMesh straight = turned_grid(Eigen::Matrix3d::Identity());
  const ElasticBody reference(straight, kSlidingTissue, sliding(straight, {}, false));
  const StaticSolution expected = reference.solve(pull(straight, Eigen::Matrix3d::Identity()));
  const Eigen::Matrix3d turn = oblique();
  const ElasticBody body(turned_grid(turn), kSlidingTissue, sliding(straight, turn, true));
  EXPECT_EQ(body.unknowns(), reference.unknowns());
  const StaticSolution found = body.solve(pull(straight, turn));
  double displacement_m = 0, reaction_n = 0;
  for (std::size_t node = 0; node < straight.nodes.size(); ++node) {
    displacement_m = std::max(displacement_m, (found.displacement_m.segment<3>(first_row(node)) -
                                               turn * expected.displacement_m.segment<3>(first_row(node)))
                                                  .norm());
    reaction_n = std::max(reaction_n, (found.reaction_force_n.segment<3>(first_row(node)) -
                                       turn * expected.reaction_force_n.segment<3>(first_row(node)))
                                          .norm());
  }
  EXPECT_LT(displacement_m, kRoundOff * expected.displacement_m.cwiseAbs().maxCoeff());
  EXPECT_LT(reaction_n, kRoundOff * expected.reaction_force_n.cwiseAbs().maxCoeff());
  RecordProperty("displacement", std::to_string(displacement_m));
}

TEST(Sliding, NothingHoldsANodeAlongItsPlane) {
  const TetMesh straight = turned_grid(Eigen::Matrix3d::Identity());
  const Eigen::Matrix3d turn = oblique();
  const ElasticBody body(turned_grid(turn), kSlidingTissue, sliding(straight, turn, true));
  const StaticSolution found = body.solve(pull(straight, turn));
  const Vector3 normal = turn.col(2);
  double slid_m = 0;
  for (std::size_t node = 0; node < straight.nodes.size(); ++node) {
    const Vector3& place = straight.nodes[node];
    if (place.z() > 0 || place.x() == 0) continue;
    const Vector3 reaction_n = found.reaction_force_n.segment<3>(first_row(node));
    EXPECT_LT((reaction_n - normal * normal.dot(reaction_n)).norm(), 1e-15);
    const Vector3 moved_m = found.displacement_m.segment<3>(first_row(node));
    EXPECT_NEAR(normal.dot(moved_m), 1e-3, 1e-12);
    slid_m = std::max(slid_m, (moved_m - normal * normal.dot(moved_m)).norm());
  }
  EXPECT_GT(slid_m, 1e-5);
}

TEST(Sliding, OtherDisplacementsOfTheSameComponentsNeedNoOtherFactor) {
  const TetMesh straight = turned_grid(Eigen::Matrix3d::Identity());
  const Eigen::Matrix3d turn = oblique();
  const Constraints constraints = sliding(straight, turn, true);
  const ElasticBody body(turned_grid(turn), kSlidingTissue, constraints);
  const Eigen::VectorXd force_n = pull(straight, turn);
  // The solution is affine in what is prescribed and in the load.
  const Eigen::VectorXd none_m = Eigen::VectorXd::Zero(force_n.size());
  const Eigen::VectorXd pushed_m = body.solve(Eigen::VectorXd::Zero(force_n.size())).displacement_m;
  const Eigen::VectorXd pulled_m = body.solve(force_n, none_m).displacement_m;
  const Eigen::VectorXd both_m = body.solve(force_n, 2 * constraints.displacement_m()).displacement_m;
  EXPECT_LT((2 * pushed_m + pulled_m - both_m).cwiseAbs().maxCoeff(),
            kRoundOff * both_m.cwiseAbs().maxCoeff());
}

TEST(Sliding, ComplianceIsThatOfUnitForcesAndSymmetric) {
  const TetMesh straight = turned_grid(Eigen::Matrix3d::Identity());
  const Eigen::Matrix3d turn = oblique();
  const ElasticBody body(turned_grid(turn), kSlidingTissue, sliding(straight, turn, true));
  const std::vector<std::uint32_t> nodes{5, 17, 50};
  const Eigen::MatrixXd columns = body.compliance_columns(nodes);
  const Eigen::VectorXd still_m = Eigen::VectorXd::Zero(columns.rows());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (Eigen::Index component = 0; component < 3; ++component) {
      const Eigen::VectorXd force_n = Eigen::VectorXd::Unit(columns.rows(), first_row(nodes[i]) + component);
      const Eigen::VectorXd column = columns.col(first_row(i) + component);
      EXPECT_LT((body.solve(force_n, still_m).displacement_m - column).norm(), kRoundOff * column.norm());
      for (std::size_t j = 0; j < nodes.size(); ++j) {
        EXPECT_LT((columns.block<3, 3>(first_row(nodes[j]), first_row(i)).transpose() -
                   columns.block<3, 3>(first_row(nodes[i]), first_row(j)))
                      .norm(),
                  kRoundOff * columns.norm());
      }
    }
  }
}

TEST(Sliding, ACutBodyGoesOnSliding) {
  const Eigen::Matrix3d turn = oblique();
  const TetMesh straight = turned_grid(Eigen::Matrix3d::Identity());
  TetMesh mesh = turned_grid(turn);
  ElasticBody body(mesh, kSlidingTissue, sliding(straight, turn, true));
  body.apply({{}, {}, {0, 1}}, {});  // at the corner, on the plane
  mesh.tetrahedra.erase(mesh.tetrahedra.begin(), mesh.tetrahedra.begin() + 2);
  mesh.regions.resize(mesh.tetrahedra.size());
  const ElasticBody fresh(mesh, kSlidingTissue, sliding(straight, turn, true));
  const Eigen::VectorXd force_n = pull(straight, turn);
  EXPECT_EQ(body.solve(force_n).displacement_m, fresh.solve(force_n).displacement_m);
}

TEST(Sliding, SaysAlongWhatABodyCanStillSlide) {
  const Eigen::Matrix3d turn = oblique();
  const TetMesh mesh = turned_grid(turn);
  Constraints constraints(mesh.nodes.size());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    constraints.turn(node, turn);
    constraints.prescribe(node, 0, 0, "line");
    constraints.prescribe(node, 1, 0, "line");
  }
  try {
    const ElasticBody body(mesh, kSlidingTissue, constraints);
    FAIL() << "a body on a rail stands still";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("can move along the direction ("));
  }
}

TEST(Sliding, RefusesAxesThatAreNone) {
  Constraints constraints(2);
  EXPECT_THROW(constraints.turn(0, 2 * Eigen::Matrix3d::Identity()), Error);
  EXPECT_THROW(constraints.turn(0, -Eigen::Matrix3d::Identity()), Error);
  Eigen::Matrix3d none = Eigen::Matrix3d::Identity();
  none(0, 1) = std::nan("");
  EXPECT_THROW(constraints.turn(0, none), Error);
  constraints.prescribe(1, 0, 0.5, "fixed[0]");
  try {
    constraints.turn(1, oblique());
    FAIL() << "what is prescribed would mean something else";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("fixed[0] prescribes how it moves already"));
  }
}

TEST(Sliding, LargeRotationsRefuseAxesOfTheirOwn) {
  const TetMesh straight = turned_grid(Eigen::Matrix3d::Identity());
  EXPECT_THROW(
      CorotationalBody(straight, kSlidingTissue, sliding(straight, Eigen::Matrix3d::Identity(), true)),
      Error);
}

}  // namespace
}  // namespace kiroku::sim
