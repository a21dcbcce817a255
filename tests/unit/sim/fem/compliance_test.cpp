#include "sim/fem/compliance.h"

#include <chrono>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/eventually.h"
#include "tests/support/tet_cylinder.h"

namespace kiroku::sim {
namespace {

class ComplianceTest : public testing::Test {
 protected:
  static ElasticBody held_cylinder() {
    TetMesh mesh = test::tet_cylinder(3, 6, 0.03, 0.1);
    Constraints constraints(mesh.nodes.size());
    for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
      if (mesh.nodes[node].z() == 0) constraints.prescribe(node, Vector3::Zero(), "test");
    }
    constraints.prescribe(mesh.nodes.size() - 1, 1, 0, "test");
    return {std::move(mesh), {{0, {1e4, 0.4}}}, constraints};
  }
  /// Of the whole surface; some are held.
  [[nodiscard]] std::vector<std::uint32_t> surface() const {
    std::vector<std::uint32_t> nodes;
    for (std::uint32_t node = 0; node < body_.mesh().nodes.size(); ++node) {
      const Vector3& at = body_.mesh().nodes[node];
      if (at.head<2>().norm() > 0.029 || at.z() > 0.099) nodes.push_back(node);
    }
    return nodes;
  }
  /// (3 |rows| x 3), found anew by asking for the node.
  static Eigen::MatrixXd columns_of(Compliance& compliance, std::uint32_t node) {
    const auto group = compliance.group_of(node);
    return group->columns.middleCols<3>(Compliance::first_column(*group, node));
  }

  ElasticBody body_ = held_cylinder();
  static constexpr std::size_t kColumnBytes = 9 * sizeof(double);  // of a node, a row
};

TEST_F(ComplianceTest, ColumnsAreTheDisplacementsOfUnitForces) {
  Compliance compliance(body_, surface());
  ASSERT_TRUE(compliance.complete());
  const auto size = static_cast<Eigen::Index>(3 * body_.mesh().nodes.size());
  for (const std::uint32_t node : surface()) {
    const Eigen::MatrixXd columns = columns_of(compliance, node);
    for (Eigen::Index component = 0; component < 3; ++component) {
      const Eigen::VectorXd expected =
          body_.solve(Eigen::VectorXd::Unit(size, 3 * Eigen::Index{node} + component)).displacement_m;
      EXPECT_LE((columns.col(component) - expected).norm(), 1e-11 * expected.norm()) << node;
    }
  }
}

TEST_F(ComplianceTest, BlocksAreSymmetric) {
  Compliance compliance(body_, surface());
  for (const std::uint32_t one : surface()) {
    for (const std::uint32_t other : {surface().front(), surface()[40], surface().back()}) {
      const Eigen::Matrix3d there = columns_of(compliance, one).middleRows<3>(3 * Eigen::Index{other});
      const Eigen::Matrix3d back = columns_of(compliance, other).middleRows<3>(3 * Eigen::Index{one});
      EXPECT_LE((there - back.transpose()).norm(), 1e-12 * (there.norm() + 1e-3)) << one << " " << other;
    }
  }
}

TEST_F(ComplianceTest, GivesTheSameBitsWhateverTheThreadsTheMemoryAndTheOrder) {
  const std::vector<std::uint32_t> nodes = surface();
  Compliance alone(body_, nodes, {1});
  Compliance together(body_, nodes, {4});
  // Room for two groups: columns go and are computed again.
  Compliance small(body_, nodes, {2, 2 * Compliance::kGroupSize * nodes.size() * kColumnBytes});
  ASSERT_FALSE(small.complete());
  EXPECT_EQ(small.rows(), nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const std::uint32_t node = nodes[(i * 37) % nodes.size()];
    const Eigen::MatrixXd expected = columns_of(alone, node);
    EXPECT_EQ(columns_of(together, node), expected);
    const Eigen::MatrixXd on_demand = columns_of(small, node);
    for (const std::uint32_t row : nodes) {
      EXPECT_EQ(on_demand.middleRows<3>(static_cast<Eigen::Index>(3 * small.row_of(row))),
                expected.middleRows<3>(3 * Eigen::Index{row}));
    }
  }
}

TEST_F(ComplianceTest, KeepsToItsMemoryAndToWhatIsHeld) {
  const std::vector<std::uint32_t> nodes = surface();
  const std::size_t group_bytes = Compliance::kGroupSize * nodes.size() * kColumnBytes;
  Compliance compliance(body_, nodes, {1, 2 * group_bytes});
  const auto held = compliance.group_of(nodes.front());
  for (const std::uint32_t node : nodes) {
    (void)compliance.group_of(node);
    EXPECT_LE(compliance.usage().columns_bytes, 2 * group_bytes);
  }
  EXPECT_EQ(compliance.group_of(nodes.front()), held);
  // Every group once, and none again that was still there.
  EXPECT_GE(compliance.usage().groups_computed, nodes.size() / Compliance::kGroupSize);
  const auto all = compliance.groups_of(nodes);
  EXPECT_EQ(all.size(), nodes.size());
  EXPECT_GT(compliance.usage().columns_bytes, 2 * group_bytes);  // all of them are held
}

TEST_F(ComplianceTest, AWorkerComputesWhatIsFetchedAhead) {
  const std::vector<std::uint32_t> nodes = surface();
  Compliance compliance(body_, nodes, {1, 10 * Compliance::kGroupSize * nodes.size() * kColumnBytes});
  compliance.prefetch(std::span(nodes).first(3));
  ASSERT_TRUE(test::eventually([&] { return compliance.usage().groups_computed > 0; }));
  EXPECT_EQ(compliance.usage().groups_waited_for, 0U);
  // Beside the worker, from two threads: what it computes is neither computed twice nor torn.
  compliance.prefetch(nodes);
  std::thread other([&] { (void)compliance.groups_of(nodes); });
  (void)compliance.groups_of(nodes);
  other.join();
}

TEST_F(ComplianceTest, RefusesNodesThatAreNotThereOrNotChosen) {
  const auto count = static_cast<std::uint32_t>(body_.mesh().nodes.size());
  EXPECT_THROW(Compliance(body_, {count}), Error);
  EXPECT_THROW(Compliance(body_, {1, 2, 1}), Error);
  Compliance compliance(body_, {count - 1});
  EXPECT_THROW((void)compliance.group_of(0), Error);
  EXPECT_THROW(compliance.prefetch(std::vector<std::uint32_t>{0}), Error);
  Compliance none(body_, {});
  EXPECT_TRUE(none.complete());
}

TEST_F(ComplianceTest, HeldNodesDoNotMove) {
  Compliance compliance(body_, {0, 30});
  EXPECT_EQ(body_.free_components(0), 0U);
  EXPECT_EQ(body_.free_components(body_.mesh().nodes.size() - 1), 2U);
  EXPECT_EQ(columns_of(compliance, 0), Eigen::MatrixXd::Zero(columns_of(compliance, 0).rows(), 3));
}

}  // namespace
}  // namespace kiroku::sim
