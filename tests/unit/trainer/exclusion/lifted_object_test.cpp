#include "trainer/exclusion/lifted_object.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/unit/trainer/made_object.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

/// What ContactBody refers to.
struct Made {
  explicit Made(OrganObject made)
      : object(std::move(made)), body(object.mesh, object.materials, object.constraints), contact(body) {}
  OrganObject object;
  sim::ElasticBody body;
  sim::ContactBody contact;
};

const Made& liver() {
  static const Made kMade(made_object(ObjectKind::kLiver, 2500));
  return kMade;
}

TEST(LiftedObject, FingersThatLieTogetherLiftLessTissueWithLessForce) {
  const ExclusionTask task = exclusion_task(ObjectKind::kLiver);
  for (const std::size_t fingers : {2U, 3U, 5U}) {
    const LiftedObject spread = lift_border(liver().contact, task, fingers, LiftManner::kSpread, 0.01),
                       together = lift_border(liver().contact, task, fingers, LiftManner::kTogether, 0.01);
    ASSERT_EQ(spread.forces_n.size(), fingers);
    EXPECT_LT(std::ranges::max(together.forces_n), std::ranges::max(spread.forces_n)) << fingers;
    EXPECT_LT(together.high_von_mises_pa, spread.high_von_mises_pa) << fingers;
  }
  EXPECT_THROW((void)lift_border(liver().contact, task, 6, LiftManner::kSpread, 0.01), UsageError);
  EXPECT_THROW((void)lift_border(liver().contact, task, 3, LiftManner::kSpread, 0), UsageError);
}

TEST(LiftedObject, StressGathersWhereAStiffBronchusMeetsSoftTissue) {
  const ExclusionTask task = exclusion_task(ObjectKind::kLung);
  OrganObject uniform = made_object(ObjectKind::kLung, 4000);
  const Made stiff(uniform);
  for (auto& [region, material] : uniform.materials) material.young_modulus_pa = 0.1e6;
  const Made soft(uniform);
  const std::vector<bool> meets = at_interface(stiff.object.mesh, stiff.object.materials);
  EXPECT_GT(std::ranges::count(meets, true), 100);
  EXPECT_EQ(std::ranges::count(at_interface(soft.object.mesh, soft.object.materials), true), 0);
  const auto peak = [&](const Made& made) {
    return peak_away(made.object.mesh, lift_border(made.contact, task, 3, LiftManner::kSpread, 0.01));
  };
  const StressPeak with = peak(stiff), without = peak(soft);
  RecordProperty("peak_kpa", std::to_string(with.von_mises_pa / 1e3));
  RecordProperty("ratio", std::to_string(with.von_mises_pa / without.von_mises_pa));
  EXPECT_TRUE(meets[with.tetrahedron]);
  EXPECT_GT(with.von_mises_pa, 2 * without.von_mises_pa);
}

}  // namespace
}  // namespace kiroku::trainer
