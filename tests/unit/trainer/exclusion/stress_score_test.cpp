#include "trainer/exclusion/stress_score.h"

#include <cmath>

#include <gtest/gtest.h>

#include "sim/mesh/tet_grid.h"
#include "trainer/exclusion/lifted_object.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

std::vector<double> volumes_of(const sim::TetMesh& mesh) {
  std::vector<double> volumes_m3;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t)
    volumes_m3.push_back(sim::signed_volume_m3(mesh, t));
  return volumes_m3;
}

TEST(StressOfShare, IsThatOfAKnownDistribution) {
  // Stress grows along x from 0 to 1 Pa: a share s of the volume has more than 1 - s.
  const sim::TetMesh mesh = sim::tet_grid({40, 3, 3}, {1, 0.1, 0.1});
  std::vector<sim::SymmetricTensor> at_nodes_pa;
  for (const Vector3& node : mesh.nodes) {
    sim::SymmetricTensor stress_pa = sim::SymmetricTensor::Zero();
    stress_pa[0] = node.x();
    at_nodes_pa.push_back(stress_pa);
  }
  const std::vector<double> volumes_m3 = volumes_of(mesh);
  for (const double share : {0.01, 0.1, 0.5, 0.9})
    EXPECT_NEAR(stress_of_share_pa(mesh, volumes_m3, at_nodes_pa, share), 1 - share, 0.015) << share;
  // One node's spike is nothing to it.
  const double before_pa = stress_of_share_pa(mesh, volumes_m3, at_nodes_pa, 0.05);
  at_nodes_pa[0][0] = 1e6;
  EXPECT_NEAR(stress_of_share_pa(mesh, volumes_m3, at_nodes_pa, 0.05), before_pa, 0.02);
  EXPECT_EQ(stress_of_share_pa({}, {}, {}), 0);
}

/// Three fingertips lift the object's border by a centimetre from where they touch it.
LiftedObject lifted(ObjectKind kind, std::size_t vertices) {
  const OrganObject object = make_object(kind, vertices);
  const sim::ElasticBody body(object.mesh, object.materials, object.constraints);
  return lift_border(sim::ContactBody(body), exclusion_task(kind), 3, LiftManner::kSpread, 0.01);
}

class StressUnderRefinement : public testing::TestWithParam<ObjectKind> {};
INSTANTIATE_TEST_SUITE_P(NightlyObjects, StressUnderRefinement,
                         testing::Values(ObjectKind::kLiver, ObjectKind::kLung),
                         [](const auto& kind) { return kind.param == ObjectKind::kLiver ? "A" : "B"; });

TEST_P(StressUnderRefinement, TheScoreConvergesAndTheLargestDoesNot) {
  // Of B some numbers of vertices between are refused by what makes meshes.
  const std::vector<std::size_t> vertices = GetParam() == ObjectKind::kLiver
                                                ? std::vector<std::size_t>{1500, 3000, 6000, 12000}
                                                : std::vector<std::size_t>{2000, 4000, 8000};
  std::vector<LiftedObject> found;
  for (const std::size_t wanted : vertices) {
    found.push_back(lifted(GetParam(), wanted));
    RecordProperty("largest_kpa_" + std::to_string(wanted),
                   std::to_string(found.back().largest_von_mises_pa / 1e3));
    RecordProperty("score_kpa_" + std::to_string(wanted),
                   std::to_string(found.back().high_von_mises_pa / 1e3));
  }
  const auto change = [&](std::size_t i, double LiftedObject::*stress_pa) {
    return std::abs(found[i].*stress_pa / found[i - 1].*stress_pa - 1);
  };
  const std::size_t last = found.size() - 1;
  RecordProperty("score_change_percent",
                 std::to_string(100 * change(last, &LiftedObject::high_von_mises_pa)));
  EXPECT_LT(change(last, &LiftedObject::high_von_mises_pa), 0.05);
  EXPECT_LT(change(last, &LiftedObject::high_von_mises_pa), change(1, &LiftedObject::high_von_mises_pa));
  // The largest goes on changing by more than that, from one mesh to the next.
  EXPECT_GT(change(last, &LiftedObject::largest_von_mises_pa), 0.15);
}

}  // namespace
}  // namespace kiroku::trainer
