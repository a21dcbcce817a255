#include "trainer/objects/organ_object.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/contact/contact_body.h"
#include "sim/mesh/mesh_check.h"
#include "tests/support/calculix.h"
#include "trainer/exclusion/exclusion_body.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

/// An object pressed from below by two fingertips, which glide or drag it along.
struct Press {
  Press(ObjectKind kind, bool rubs)
      : object(make_object(kind, 900)),
        body(object.mesh, object.materials, object.constraints),
        contact(body),
        solver(contact.whole_surface(), {{"finger 1", sim::Sphere{0.01}, rubs, kFingertipFriction},
                                         {"finger 2", sim::Sphere{0.01}, rubs, kFingertipFriction}}) {
    std::vector<sim::Pose> poses(2);
    for (int step = 0; step <= 10; ++step) {
      for (std::size_t i = 0; i < 2; ++i)
        poses[i].position_m = {i == 0 ? -0.03 : 0.03, -0.035 + 3e-4 * step,
                               -half_thickness_m(kind) - 0.01 + 8e-4 * step};
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
  EXPECT_THROW((void)object_kind("c"), UsageError);
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

class PressedObject : public testing::TestWithParam<std::tuple<ObjectKind, bool>> {};

TEST_P(PressedObject, ForcesAreInEquilibriumWithTheFixedEnds) {
  const Press press(std::get<0>(GetParam()), std::get<1>(GetParam()));
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
  const Press press(std::get<0>(GetParam()), std::get<1>(GetParam()));
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
                                          testing::Bool()),
                         [](const auto& test) {
                           return name_of(std::get<0>(test.param)) +
                                  (std::get<1>(test.param) ? "_rubs" : "_glides");
                         });

}  // namespace
}  // namespace kiroku::trainer
