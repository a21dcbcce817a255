// What small displacements cost an attempt: a border that is lifted far, by the linear body of the force loop
// and by the corotational one, which may turn as far as it likes.
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <gtest/gtest.h>

#include "sim/manipulation/corotational_manipulation.h"
#include "tests/unit/trainer/made_object.h"
#include "trainer/exclusion/lifted_object.h"
#include "trainer/exclusion/stress_score.h"

namespace kiroku::trainer {
namespace {

constexpr std::size_t kFingers = 3;
constexpr std::array kHeightsMillimetres{5, 10, 20};
/// How far the linear force and stress of each height may be off; docs/results/simulation-validation.md has
/// how far they are.
constexpr std::array kMostOfForce{0.03, 0.13, 0.27}, kMostOfStress{0.04, 0.1, 0.15};

struct FarLift {
  double wrist_n = 0;
  double high_von_mises_pa = 0;
  double volume_m3 = 0;
};

double volume_of(sim::TetMesh mesh, const Eigen::VectorXd& displacement_m) {
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node)
    mesh.nodes[node] += displacement_m.segment<3>(3 * static_cast<Eigen::Index>(node));
  double sum_m3 = 0;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) sum_m3 += sim::signed_volume_m3(mesh, t);
  return sum_m3;
}

FarLift far_lift(const OrganObject& object, double wrist_n,
                 const std::vector<sim::SymmetricTensor>& at_nodes_pa,
                 const Eigen::VectorXd& displacement_m) {
  std::vector<double> volumes_m3;
  for (std::size_t t = 0; t < object.mesh.tetrahedra.size(); ++t)
    volumes_m3.push_back(sim::signed_volume_m3(object.mesh, t));
  return {wrist_n, stress_of_share_pa(object.mesh, volumes_m3, at_nodes_pa),
          volume_of(object.mesh, displacement_m)};
}

/// The same fingertips as those of lift_border(), on a body of large rotations; at each of the heights.
std::vector<FarLift> corotational_lifts(const OrganObject& object, const ExclusionTask& task) {
  const sim::CorotationalBody body(object.mesh, object.materials, object.constraints);
  std::vector<sim::Tool> tools;
  std::vector<sim::OptionalPose> poses;
  for (const double side_m : side_by_side_m(kFingers)) {
    tools.push_back(sim::finger("finger " + std::to_string(tools.size() + 1), kFingertipMetres, true));
    tools.back().friction = task.friction;
    poses.emplace_back(sim::Pose{});
    poses.back()->position_m = task.under_border_m + side_m * task.aside;
  }
  const Eigen::VectorXd none_n =
      Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(object.mesh.nodes.size()));
  sim::CorotationalManipulation hand(body, none_n, tools);
  std::vector<FarLift> found;
  for (int mm = 1; mm <= kHeightsMillimetres.back(); ++mm) {
    for (sim::OptionalPose& pose : poses) pose->position_m += 1e-3 * task.lifts;
    hand.step(poses);
    if (std::ranges::find(kHeightsMillimetres, mm) == kHeightsMillimetres.end()) continue;
    found.push_back(far_lift(object, hand.result().wrist_force_n.norm(),
                             body.linear().at_nodes(body.stress_pa(hand.displacement_m())),
                             hand.displacement_m()));
  }
  return found;
}

TEST(LargeLift, LinearForcesAndStressAreOffByWhatIsStated) {
  for (const ObjectKind kind : {ObjectKind::kLiver, ObjectKind::kLung}) {
    const OrganObject& object = made_object(kind, 2000);
    const ExclusionTask task = exclusion_task(kind);
    const sim::ElasticBody body(object.mesh, object.materials, object.constraints);
    const sim::ContactBody contact(body);
    const double rest_m3 = volume_of(
        object.mesh, Eigen::VectorXd::Zero(3 * static_cast<Eigen::Index>(object.mesh.nodes.size())));
    const std::vector<FarLift> turning = corotational_lifts(object, task);
    for (std::size_t i = 0; i < kHeightsMillimetres.size(); ++i) {
      const LiftedObject lifted =
          lift_border(contact, task, kFingers, LiftManner::kSpread, 1e-3 * kHeightsMillimetres[i]);
      const FarLift linear =
          far_lift(object, lifted.wrist_n, body.at_nodes(lifted.stress_pa), lifted.displacement_m);
      const double of_force = linear.wrist_n / turning[i].wrist_n - 1;
      const double of_stress = linear.high_von_mises_pa / turning[i].high_von_mises_pa - 1;
      const std::string which = name_of(kind) + "_" + std::to_string(kHeightsMillimetres[i]) + "mm";
      RecordProperty("force_percent_" + which, std::to_string(100 * of_force));
      RecordProperty("stress_percent_" + which, std::to_string(100 * of_stress));
      RecordProperty("volume_percent_" + which, std::to_string(100 * (linear.volume_m3 / rest_m3 - 1)));
      RecordProperty("turning_volume_percent_" + which,
                     std::to_string(100 * (turning[i].volume_m3 / rest_m3 - 1)));
      EXPECT_LT(std::abs(of_force), kMostOfForce[i]) << which;
      EXPECT_LT(std::abs(of_stress), kMostOfStress[i]) << which;
    }
  }
}

}  // namespace
}  // namespace kiroku::trainer
