#include "sim/cutting/rest_mapping.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/organ_mesh.h"

namespace kiroku::sim {
namespace {

class RestMappingTest : public testing::Test {
 protected:
  /// A displacement that is linear, so that it is the same inside elements as at nodes.
  [[nodiscard]] Vector3 deformed(const Vector3& point) const { return point + gradient_ * point + move_m_; }
  [[nodiscard]] Eigen::VectorXd displacement_m() const {
    Eigen::VectorXd displacement_m(static_cast<Eigen::Index>(3 * shape_.mesh().nodes.size()));
    for (std::size_t node = 0; node < shape_.mesh().nodes.size(); ++node) {
      const Vector3& at = shape_.mesh().nodes[node];
      displacement_m.segment<3>(static_cast<Eigen::Index>(3 * node)) = deformed(at) - at;
    }
    return displacement_m;
  }

  VertexPreservingCut shape_{test::organ_mesh({8, 6, 5}, {0.2, 0.14, 0.1})};
  Eigen::Matrix3d gradient_ = (Eigen::Matrix3d() << 0.2, 0.1, 0, -0.1, -0.15, 0.3, 0, -0.2, 0.1).finished();
  Vector3 move_m_{0.01, -0.02, 0.03};
};

TEST_F(RestMappingTest, BringsPointsInsideBackExactly) {
  const RestMapping mapping(shape_, displacement_m());
  std::mt19937 random(4);
  for (int i = 0; i < 200; ++i) {
    const Vector3 rest(0.1 * (test::uniform(random) - 0.5), 0.06 * (test::uniform(random) - 0.5),
                       0.04 * (test::uniform(random) - 0.5));
    EXPECT_LE((mapping.to_rest(deformed(rest)) - rest).norm(), 1e-14);
    EXPECT_LE((mapping.to_deformed(rest) - deformed(rest)).norm(), 1e-14);
  }
  // A node belongs to many tetrahedra.
  for (const Vector3& node : shape_.mesh().nodes)
    EXPECT_LE((mapping.to_rest(deformed(node)) - node).norm(), 1e-14);
}

TEST_F(RestMappingTest, TakesPointsOutsideAlongWithTheNearestOfTheSurface) {
  Eigen::VectorXd moved_m = Eigen::VectorXd::Zero(displacement_m().size());
  for (Eigen::Index i = 0; i < moved_m.size(); i += 3) moved_m.segment<3>(i) = move_m_;
  const RestMapping mapping(shape_, moved_m);
  const BladePose rest{{0.3, 0.1, 0.2}, {-0.4, 0, 0}};
  const BladePose found = mapping.to_rest(BladePose{rest.tip + move_m_, rest.heel + move_m_});
  EXPECT_LE((found.tip - rest.tip).norm(), 1e-15);
  EXPECT_LE((found.heel - rest.heel).norm(), 1e-15);
  const BladePose back = mapping.to_deformed(rest);
  EXPECT_LE((back.tip - rest.tip - move_m_).norm(), 1e-15);
  EXPECT_LE((back.heel - rest.heel - move_m_).norm(), 1e-15);
}

TEST_F(RestMappingTest, HasNoJumpAtTheSurface) {
  const RestMapping mapping(shape_, displacement_m());
  for (const Face& face : shape_.surface()) {
    const auto& nodes = shape_.mesh().nodes;
    const Vector3 a = deformed(nodes[face.nodes[0]]), b = deformed(nodes[face.nodes[1]]),
                  c = deformed(nodes[face.nodes[2]]);
    const Vector3 middle = (a + b + c) / 3, out = 1e-9 * (b - a).cross(c - a).normalized();
    EXPECT_LE((mapping.to_rest(middle + out) - mapping.to_rest(middle - out)).norm(), 1e-8);
  }
}

TEST_F(RestMappingTest, RefusesADisplacementThatIsNotTheBodys) {
  EXPECT_THROW(RestMapping(shape_, Eigen::VectorXd::Zero(3)), Error);
  Eigen::VectorXd bad = displacement_m();
  bad[5] = NAN;
  EXPECT_THROW(RestMapping(shape_, bad), Error);
}

}  // namespace
}  // namespace kiroku::sim
