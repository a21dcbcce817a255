#include "trainer/objects/organ_object.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <memory>
#include <tuple>

#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/contact/contact_body.h"
#include "sim/mesh/mesh_check.h"
#include "tests/support/calculix.h"
#include "tests/unit/trainer/made_object.h"
#include "trainer/exclusion/exclusion_body.h"
#include "trainer/exclusion/hand_forces.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

/// What an object is pressed from below by: two fingertips that glide or drag it along, or a whole hand whose
/// palm and phalanges lie under it, too.
enum class Manner : std::uint8_t { kGlides, kRubs, kHand };

std::string suffix_of(Manner manner) {
  if (manner == Manner::kHand) return "_hand";
  return manner == Manner::kRubs ? "_rubs" : "_glides";
}

std::vector<sim::ContactTool> tools_of(Manner manner) {
  if (manner == Manner::kHand) {
    std::vector<sim::ContactTool> tools = fingertips(2, kFingertipFriction);
    std::ranges::move(HandShape(2).tools(kFingertipFriction), std::back_inserter(tools));
    return tools;
  }
  const bool rubs = manner == Manner::kRubs;
  return {{"finger 1", sim::Sphere{0.01}, rubs, kFingertipFriction},
          {"finger 2", sim::Sphere{0.01}, rubs, kFingertipFriction}};
}

struct Press {
  Press(ObjectKind kind, Manner manner)
      : object(made_object(kind, 900)),
        body(object.mesh, object.materials, object.constraints),
        contact(body),
        solver(contact.whole_surface(), tools_of(manner)) {
    const bool hand = manner == Manner::kHand;
    poses.resize(solver.tools().size());
    const double below_m = -half_thickness_m(kind);
    if (hand) {  // bent a little, so that the phalanges behind the fingertips lie under the object, too
      for (std::size_t i = 0; i < 2; ++i) poses[i].orientation = Eigen::AngleAxisd(-0.08, Vector3::UnitX());
    }
    for (int step = 0; step <= 10; ++step) {
      const double lifted_m = 8e-4 * step, ahead_m = 3e-4 * step;
      for (std::size_t i = 0; i < 2; ++i) {
        poses[i].position_m = {i == 0 ? -0.03 : 0.03, (hand ? 0.028 : -0.035) + ahead_m,
                               below_m - (hand ? kFingertipMetres : 0.01) + lifted_m};
      }
      if (hand) {
        const sim::Pose wrist{{0, -0.11 + ahead_m, below_m - HandShape::kPalmRadiusMetres + lifted_m},
                              Eigen::Quaterniond::Identity()};
        HandShape(2).place(wrist, std::span(poses).first(2), std::span(poses).subspan(2));
      }
      solver.step(poses);
    }
    contact.displacement_m(solver.result().contacts, displacement_m);
    force_n = Eigen::VectorXd::Zero(displacement_m.size());
    for (const sim::Contact& touch : solver.result().contacts)
      force_n.segment<3>(static_cast<Eigen::Index>(3 * std::size_t{touch.node})) += touch.force_n;
  }
  OrganObject object;
  sim::ElasticBody body;
  sim::ContactBody contact;
  sim::ContactSolver solver;
  std::vector<sim::Pose> poses;
  Eigen::VectorXd displacement_m, force_n;
};

TEST(OrganObject, HasItsRegionsAndElasticitiesAtAnyResolution) {
  for (const unsigned vertices : {900U, 1800U}) {
    const OrganObject a = make_object(ObjectKind::kLiver, vertices),
                      b = make_object(ObjectKind::kLung, vertices);
    for (const OrganObject* object : {&a, &b}) {
      EXPECT_NEAR(static_cast<double>(object->mesh.nodes.size()), static_cast<double>(vertices),
                  0.15 * vertices);
      EXPECT_EQ(sim::regions_of(object->mesh), (std::vector<std::int32_t>{1, 2, 3}));
      const sim::Extent extent = sim::extent_of(object->mesh);
      EXPECT_NEAR(extent.greatest.x(), 0.1, 3e-3);
      EXPECT_NEAR(extent.greatest.y(), 0.06, 4e-3);
      EXPECT_NEAR(-extent.least.z(), half_thickness_m(object_kind(object->name)), 3e-3);
      for (const auto& [region, material] : object->materials) EXPECT_EQ(material.poisson_ratio, 0.4);
    }
    for (const auto& [region, material] : a.materials) EXPECT_EQ(material.young_modulus_pa, 0.3e6);
    EXPECT_EQ(b.materials.at(1).young_modulus_pa, 0.1e6);
    EXPECT_EQ(b.materials.at(2).young_modulus_pa, 1e6);
    EXPECT_EQ(b.materials.at(3).young_modulus_pa, 1e6);
  }
  EXPECT_THROW((void)make_object(ObjectKind::kLiver, 10), UsageError);
  EXPECT_EQ(object_kind("b"), ObjectKind::kLung);
  EXPECT_EQ(object_kind("c"), ObjectKind::kVessels);
  EXPECT_THROW((void)object_kind("d"), UsageError);
}

TEST(OrganObject, CIsAGreatVeinAndAnAortaBesideIt) {
  for (const unsigned vertices : {900U, 1800U, 4000U}) {
    const OrganObject c = make_object(ObjectKind::kVessels, vertices);
    EXPECT_EQ(c.name, "c");
    EXPECT_NEAR(static_cast<double>(c.mesh.nodes.size()), static_cast<double>(vertices), 0.15 * vertices);
    EXPECT_EQ(sim::regions_of(c.mesh), (std::vector<std::int32_t>{1, 2, 3}));
    const sim::Extent extent = sim::extent_of(c.mesh);
    EXPECT_NEAR(extent.greatest.x(), 0.1, 3e-3);
    EXPECT_NEAR(extent.greatest.y(), half_width_m(ObjectKind::kVessels), 2e-3);
    EXPECT_NEAR(-extent.least.y(), half_width_m(ObjectKind::kVessels), 2e-3);
    EXPECT_NEAR(extent.greatest.z(), half_thickness_m(ObjectKind::kVessels), 2e-3);
    EXPECT_LT(c.materials.at(1).young_modulus_pa, c.materials.at(2).young_modulus_pa);
    // The vein lies towards the trainee. Both are round: nothing is in the corners of what holds them.
    for (std::size_t t = 0; t < c.mesh.tetrahedra.size(); ++t) {
      Vector3 middle = Vector3::Zero();
      for (const std::uint32_t node : c.mesh.tetrahedra[t]) middle += c.mesh.nodes[node] / 4;
      if (c.mesh.regions[t] == 1) {
        EXPECT_LT(middle.y(), 1e-3);
      } else if (c.mesh.regions[t] == 2) {
        EXPECT_GT(middle.y(), -1e-3);
      }
      EXPECT_LT(std::hypot(std::abs(middle.y()) - 0.0115, middle.z()), 0.0135) << middle.transpose();
    }
  }
}

TEST(OrganObject, AHasGroovesBetweenItsLobes) {
  const OrganObject a = make_object(ObjectKind::kLiver, 1500);
  // The highest node near the middle line of the upper side, over a groove and beside it.
  const auto height_at = [&](double x) {
    double highest_m = -1;
    for (const Vector3& node : a.mesh.nodes) {
      if (std::abs(node.x() - x) < 0.003 && std::abs(node.y()) < 0.035)
        highest_m = std::max(highest_m, node.z());
    }
    return highest_m;
  };
  for (const double groove : {-0.033, 0.033}) EXPECT_LT(height_at(groove), height_at(0) - 0.003);
  EXPECT_NEAR(height_at(0), 0.015, 2e-3);
}

TEST(OrganObject, IsTheSameEachTime) {
  EXPECT_EQ(make_object(ObjectKind::kLung, 800).mesh.nodes, make_object(ObjectKind::kLung, 800).mesh.nodes);
}

/// What three tests look at, pressed once a process; CTest's shards have all three of one parameter in one
/// process.
class PressedObject : public testing::TestWithParam<std::tuple<ObjectKind, Manner>> {
 protected:
  static const Press& pressed() {
    static std::map<std::tuple<ObjectKind, Manner>, std::unique_ptr<const Press>> made;
    std::unique_ptr<const Press>& press = made[GetParam()];
    if (!press) press = std::make_unique<const Press>(std::get<0>(GetParam()), std::get<1>(GetParam()));
    return *press;
  }
};

/// Eq. 6 with all that touches: force and torque about a wrist against the sum over the pressed nodes.
TEST_P(PressedObject, TheWristBearsTheForcesOfAllNodes) {
  const Press& press = pressed();
  const sim::ContactResult& result = press.solver.result();
  const Vector3 wrist_m(0, -0.12, -0.03);
  std::vector<Vector3> forces_n, torques_nm;
  for (const sim::ToolForce& tool : result.tools) {
    forces_n.push_back(tool.force_n);
    torques_nm.push_back(tool.torque_nm);
  }
  const sim::WristForce wrist = sim::wrist_force_of(wrist_m, press.poses, forces_n, torques_nm);
  Vector3 sum_n = Vector3::Zero(), sum_nm = Vector3::Zero();
  for (const sim::Contact& touch : result.contacts) {
    const auto at = static_cast<Eigen::Index>(3 * std::size_t{touch.node});
    const Vector3 at_m = press.object.mesh.nodes[touch.node] + press.displacement_m.segment<3>(at);
    sum_n -= touch.force_n;
    sum_nm -= (at_m - wrist_m).cross(touch.force_n);
  }
  const double off_n = (wrist.force_n - sum_n).norm() / sum_n.norm(),
               off_nm = (wrist.torque_nm - sum_nm).norm() / sum_nm.norm();
  EXPECT_LE(off_n, 1e-12);
  EXPECT_LE(off_nm, 1e-6);
  RecordProperty("wrist_force_difference", std::to_string(off_n * 1e15) + "e-15");
  RecordProperty("wrist_torque_difference", std::to_string(off_nm * 1e9) + "e-9");
  if (std::get<1>(GetParam()) != Manner::kHand) return;
  // Every kind of part has its share: fingertips, phalanges, palm.
  const auto share_n = [&](std::size_t first, std::size_t count) {
    Vector3 share = Vector3::Zero();
    for (std::size_t tool = first; tool < first + count; ++tool) share += forces_n[tool];
    return share.norm();
  };
  const std::size_t phalanges = 2 * HandShape::kPhalanges;
  EXPECT_GT(share_n(0, 2), 0.05);
  EXPECT_GT(share_n(2, phalanges), 0.05);
  EXPECT_GT(share_n(2 + phalanges, HandShape::kPalmCapsules), 0.05);
}

TEST_P(PressedObject, ForcesAreInEquilibriumWithTheFixedEnds) {
  const Press& press = pressed();
  const sim::ContactResult& result = press.solver.result();
  EXPECT_GT(-result.wrist_force_n.z(), 0.5);  // the fingers push up, so they are pushed down
  const Eigen::VectorXd reaction_n = press.body.solve(press.force_n).reaction_force_n;
  Vector3 total_n = Vector3::Zero(), moment_nm = Vector3::Zero();
  for (std::size_t node = 0; node < press.object.mesh.nodes.size(); ++node) {
    const auto at = static_cast<Eigen::Index>(3 * node);
    const Vector3 both_n = reaction_n.segment<3>(at) + press.force_n.segment<3>(at);
    total_n += both_n;
    moment_nm += press.object.mesh.nodes[node].cross(both_n);
  }
  const double scale_n = result.wrist_force_n.norm();
  EXPECT_LT(total_n.norm(), 1e-9 * scale_n);
  EXPECT_LT(moment_nm.norm(), 1e-9 * scale_n);
}

TEST_P(PressedObject, AgreesWithCalculixInStressAndForce) {
  if (!test::has_ccx()) GTEST_SKIP() << "ccx is not installed";
  const Press& press = pressed();
  const test::CalculixCase input{press.object.mesh, press.object.materials, press.object.constraints,
                                 press.force_n};
  const test::CalculixResult theirs = test::run_calculix(input, press.force_n);
  ASSERT_EQ(theirs.nodes, press.object.mesh.nodes.size());
  ASSERT_EQ(theirs.tetrahedra, press.object.mesh.tetrahedra.size());
  const double largest_m = theirs.displacement_m.cwiseAbs().maxCoeff();
  const double off_m = (press.displacement_m - theirs.displacement_m).cwiseAbs().maxCoeff();
  double largest_pa = 0, off_pa = 0;
  for (std::size_t t = 0; t < theirs.stress_pa.size(); ++t) {
    largest_pa = std::max(largest_pa, theirs.stress_pa[t].norm());
    off_pa = std::max(off_pa, (theirs.stress_pa[t] - press.body.stress_pa(press.displacement_m, t)).norm());
  }
  EXPECT_LE(off_m, 1e-5 * largest_m);
  EXPECT_LE(off_pa, 1e-5 * largest_pa);
  // The other way round: where the fingers brought the nodes, ccx finds the forces that they felt.
  sim::Constraints pressed = press.object.constraints;
  std::vector<bool> touched(press.object.mesh.nodes.size());
  for (const sim::Contact& touch : press.solver.result().contacts) touched[touch.node] = true;
  for (std::size_t node = 0; node < touched.size(); ++node) {
    if (touched[node])
      pressed.prescribe(node, press.displacement_m.segment<3>(static_cast<Eigen::Index>(3 * node)),
                        "fingers");
  }
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(press.force_n.size());
  const test::CalculixResult held =
      test::run_calculix({press.object.mesh, press.object.materials, pressed, none}, none);
  Vector3 felt_n = Vector3::Zero();
  for (std::size_t node = 0; node < touched.size(); ++node) {
    if (touched[node]) felt_n -= held.reaction_n.segment<3>(static_cast<Eigen::Index>(3 * node));
  }
  const Vector3 wrist_n = press.solver.result().wrist_force_n;
  EXPECT_LE((felt_n - wrist_n).norm(), 1e-5 * wrist_n.norm());
  RecordProperty("force_difference",
                 std::to_string((felt_n - wrist_n).norm() / wrist_n.norm() * 1e9) + "e-9");
  RecordProperty("displacement_difference", std::to_string(off_m / largest_m * 1e9) + "e-9");
  RecordProperty("stress_difference", std::to_string(off_pa / largest_pa * 1e9) + "e-9");
}

INSTANTIATE_TEST_SUITE_P(Objects, PressedObject,
                         testing::Combine(testing::Values(ObjectKind::kLiver, ObjectKind::kLung),
                                          testing::Values(Manner::kGlides, Manner::kRubs, Manner::kHand)),
                         [](const auto& test) {
                           return name_of(std::get<0>(test.param)) + suffix_of(std::get<1>(test.param));
                         });

}  // namespace
}  // namespace kiroku::trainer
