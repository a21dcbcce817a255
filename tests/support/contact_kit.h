// Bodies and tools of contact tests, and every law that a step obeys.
#pragma once

#include <cmath>
#include <cstdio>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "sim/contact/contact_body.h"
#include "sim/contact/contact_solver.h"
#include "tests/support/tet_cylinder.h"

namespace kiroku::test {

using namespace sim;  // NOLINT(google-build-using-namespace): all that is used here

inline Eigen::Index at(std::size_t node) { return static_cast<Eigen::Index>(3 * node); }

inline void record(const char* what, double figure) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1e", figure);
  testing::Test::RecordProperty(what, text);
}

inline ElasticBody held_below(TetMesh mesh) {
  Constraints constraints(mesh.nodes.size());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (mesh.nodes[node].z() == 0) constraints.prescribe(node, Vector3::Zero(), "test");
  }
  return {std::move(mesh), {{0, {1e4, 0.4}}}, constraints};
}

inline Pose at_place(double x, double y, double z) {
  Pose pose;
  pose.position_m = {x, y, z};
  return pose;
}

inline ContactTool fingertip(const std::string& name, double radius_m = 0.01) {
  return {name, Sphere{radius_m}, false};
}

/// Every law of a step that has converged.
inline void expect_contact(const ContactSolver& solver, std::span<const Pose> poses) {
  const ContactResult& result = solver.result();
  const ContactNeighbourhood& surface = solver.neighbourhood();
  const double tolerance_m = 1e-6 * surface.size_m;
  EXPECT_TRUE(result.converged);
  double deepest_m = 0;
  for (std::size_t tool = 0; tool < poses.size(); ++tool) {
    for (std::size_t point = 0; point < surface.nodes.size(); ++point) {
      const Vector3 here_m = solver.positions_m().segment<3>(at(point));
      deepest_m = std::max(deepest_m,
                           -distance_to(solver.tools()[tool].shape, poses[tool].to_tool(here_m)).distance_m);
    }
  }
  EXPECT_LE(deepest_m, tolerance_m);
  EXPECT_NEAR(result.deepest_penetration_m, deepest_m, 1e-12);
  std::vector<Vector3> sums(poses.size(), Vector3::Zero());
  for (const Contact& contact : result.contacts) {
    EXPECT_GE(contact.force_n.dot(contact.normal), 0) << contact.node;
    EXPECT_GE(contact.pressure_pa, 0) << contact.node;
    sums[contact.tool] -= contact.force_n;
    const auto point = std::ranges::find(surface.nodes, contact.node) - surface.nodes.begin();
    const Vector3 here_m = solver.positions_m().segment<3>(3 * point);
    const double gap_m =
        distance_to(solver.tools()[contact.tool].shape, poses[contact.tool].to_tool(here_m)).distance_m;
    EXPECT_LE(std::abs(gap_m), tolerance_m) << "what presses does not touch";
  }
  Vector3 wrist_n = Vector3::Zero();
  for (std::size_t tool = 0; tool < poses.size(); ++tool) {
    EXPECT_LE((result.tools[tool].force_n - sums[tool]).norm(), 1e-12 * (1 + sums[tool].norm()));
    wrist_n += sums[tool];
  }
  EXPECT_LE((result.wrist_force_n - wrist_n).norm(), 1e-12 * (1 + wrist_n.norm()));
}

class ContactTest : public testing::Test {
 protected:
  ElasticBody body_ = held_below(tet_cylinder(5, 8, 0.03, 0.1));
  ContactBody contact_{body_};
  std::shared_ptr<const ContactNeighbourhood> surface_ = contact_.whole_surface();
};

}  // namespace kiroku::test
