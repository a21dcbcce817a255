// Contact as a law: nothing penetrates, nothing pulls, forces balance, and it is what all states tried give.
#include "sim/contact/contact_solver.h"

#include <cmath>
#include <limits>
#include <random>

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/contact/contact_body.h"
#include "tests/support/contact_kit.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using namespace test;  // NOLINT(google-build-using-namespace): the kit
using testing::HasSubstr;

TEST_F(ContactTest, FiveFingersNeitherPenetrateNorPull) {
  std::vector<ContactTool> tools;
  for (int i = 0; i < 5; ++i) tools.push_back(fingertip("finger " + std::to_string(i + 1)));
  ContactSolver solver(surface_, tools);
  std::vector<Pose> poses(5);
  double deepest_m = 0;
  for (int step = 0; step <= 40; ++step) {
    for (int i = 0; i < 5; ++i) {
      const double angle = i == 0 ? 3.1 : 0.42 * (i - 2.5), distance_m = 0.0405 - 0.0002 * step;
      poses[static_cast<std::size_t>(i)] =
          at_place(distance_m * std::cos(angle), distance_m * std::sin(angle), 0.05 + 0.002 * (i - 2));
    }
    solver.step(poses);
    expect_contact(solver, poses);
    deepest_m = std::max(deepest_m, solver.result().deepest_penetration_m);
  }
  EXPECT_GE(solver.result().contacts.size(), 5U);
  for (const ToolForce& tool : solver.result().tools) {
    EXPECT_GT(tool.nodes, 0U) << &tool - solver.result().tools.data();
    EXPECT_GT(tool.normal_n, 0);
    EXPECT_NEAR(std::hypot(tool.normal_n, tool.tangential_n), tool.force_n.norm(), 1e-12);
  }
  record("penetration_of_size", deepest_m / surface_->size_m);
  // They let go: nothing is left of them.
  for (Pose& pose : poses) pose.position_m *= 2;
  solver.step(poses);
  EXPECT_TRUE(solver.result().contacts.empty());
  EXPECT_EQ(solver.positions_m(), surface_->rest_m);
}

TEST_F(ContactTest, ReactionsBalanceTheFingers) {
  std::vector<ContactTool> tools{
      fingertip("thumb"), fingertip("finger"), {"rod", Capsule{0.005, 0.02}, true}};
  ContactSolver solver(surface_, tools);
  const std::vector<Pose> poses{at_place(0.036, 0, 0.06), at_place(-0.037, 0.002, 0.07),
                                at_place(0, 0.033, 0.05)};
  const ContactResult& result = solver.step(poses);
  ASSERT_FALSE(result.contacts.empty());
  Eigen::VectorXd force_n = Eigen::VectorXd::Zero(at(body_.mesh().nodes.size()));
  for (const Contact& contact : result.contacts) force_n.segment<3>(at(contact.node)) += contact.force_n;
  const StaticSolution solution = body_.solve(force_n);
  Vector3 reaction_n = Vector3::Zero(), moment_nm = Vector3::Zero(), tools_nm = Vector3::Zero();
  for (std::size_t node = 0; node < body_.mesh().nodes.size(); ++node) {
    const Vector3 held_n = solution.reaction_force_n.segment<3>(at(node));
    reaction_n += held_n;
    moment_nm += body_.mesh().nodes[node].cross(held_n);
  }
  const double force_scale_n = force_n.norm();
  double error = (reaction_n - result.wrist_force_n).norm() / force_scale_n;
  EXPECT_LE(error, 1e-9);
  record("force", error);
  // The moments about the tools' origins are those of the forces where the nodes now are.
  for (std::size_t i = 0; i < poses.size(); ++i)
    tools_nm += result.tools[i].torque_nm + poses[i].position_m.cross(result.tools[i].force_n);
  Vector3 contacts_nm = Vector3::Zero();
  for (const Contact& contact : result.contacts) {
    const auto point = std::ranges::find(surface_->nodes, contact.node) - surface_->nodes.begin();
    contacts_nm -= solver.positions_m().segment<3>(3 * point).cross(contact.force_n);
  }
  EXPECT_LE((tools_nm - contacts_nm).norm(), 1e-12);
  // And all nodes move as a solve of their own says.
  Eigen::VectorXd displacement_m;
  contact_.displacement_m(result.contacts, displacement_m);
  error = (displacement_m - solution.displacement_m).norm() / solution.displacement_m.norm();
  EXPECT_LE(error, 1e-9);
  record("displacement", error);
}

/// A box around x = 0, whose right half is the mirror image of the left to the bit.
TetMesh mirrored_box() {
  TetMesh half = test::tet_grid({3, 4, 5}, {0.03, 0.04, 0.06});
  TetMesh mesh;
  std::vector<std::uint32_t> right, left;
  for (const Vector3& node : half.nodes) {
    right.push_back(static_cast<std::uint32_t>(mesh.nodes.size()));
    mesh.nodes.push_back(node);
    left.push_back(node.x() == 0 ? right.back() : right.back() + 1);
    if (node.x() != 0) mesh.nodes.emplace_back(-node.x(), node.y(), node.z());
  }
  for (const Tetrahedron& corners : half.tetrahedra) {
    mesh.tetrahedra.push_back({right[corners[0]], right[corners[1]], right[corners[2]], right[corners[3]]});
    mesh.tetrahedra.push_back({left[corners[0]], left[corners[1]], left[corners[3]], left[corners[2]]});
  }
  mesh.regions.assign(mesh.tetrahedra.size(), 0);
  return mesh;
}

TEST(Contact, TwoFingersFeelTheSameOnASymmetricBody) {
  const ElasticBody body = held_below(mirrored_box());
  const ContactBody contact(body);
  for (const bool sticks : {false, true}) {
    std::vector<ContactTool> tools{fingertip("left"), fingertip("right")};
    for (ContactTool& tool : tools) tool.sticks = sticks;
    ContactSolver solver(contact.whole_surface(), tools);
    for (int step = 1; step <= 10; ++step) {
      const double x = 0.0385 - 0.0006 * step, y = 0.021, z = 0.041 + 0.0002 * step;
      const std::vector<Pose> poses{at_place(-x, y, z), at_place(x, y, z)};
      const ContactResult& result = solver.step(poses);
      expect_contact(solver, poses);
      const Vector3 &left_n = result.tools[0].force_n, &right_n = result.tools[1].force_n;
      EXPECT_GT(right_n.x(), 0);
      const double error = (left_n - Vector3(-right_n.x(), right_n.y(), right_n.z())).norm() / right_n.norm();
      EXPECT_LE(error, 1e-9) << step;
      EXPECT_LE(std::abs(result.wrist_force_n.x()), 1e-9 * right_n.norm());
      record("force", error);
    }
  }
}

// A block with a finger beside it, that another finger pushes it into from the other side.
TEST(Contact, APassiveFingerIsFoundInTheSameStep) {
  TetMesh mesh = test::tet_grid({4, 4, 8}, {0.04, 0.04, 0.12});
  const ElasticBody body = held_below(std::move(mesh));
  const ContactBody contact(body);
  ContactSolver solver(contact.whole_surface(), {fingertip("active"), fingertip("passive")});
  const double clear_m = 0.0005;
  const Pose waiting = at_place(0.05 + clear_m, 0.02, 0.12);
  solver.step(std::vector<Pose>{at_place(-0.011, 0.02, 0.12), waiting});
  EXPECT_TRUE(solver.result().contacts.empty());
  const std::vector<Pose> poses{at_place(-0.007, 0.02, 0.12), waiting};
  const ContactResult& result = solver.step(poses);
  expect_contact(solver, poses);
  EXPECT_GT(result.tools[1].nodes, 0U);
  EXPECT_GT(result.tools[1].force_n.x(), 0);
  EXPECT_LT(result.tools[0].force_n.x(), 0);
  // Pressed between both, it resists more than against one.
  ContactSolver alone(contact.whole_surface(), {fingertip("active")});
  EXPECT_GT(result.tools[0].force_n.norm(),
            1.05 * alone.step(std::vector<Pose>{poses[0]}).tools[0].force_n.norm());
}

/// Every state of the contacts there may be, each solved on its own; the planes are those of the rest state.
struct Enumerated {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> touches;  // of tool and node
  Eigen::VectorXd pressure_n;
  int answers = 0;
};
Enumerated by_enumeration(const ElasticBody& body, const ContactNeighbourhood& surface,
                          const std::vector<ContactTool>& tools, const std::vector<Pose>& poses) {
  Enumerated found;
  std::vector<Eigen::VectorXd> moves_m;  // under 1 N at each contact
  std::vector<Vector3> normals;
  std::vector<double> gaps_m;
  for (std::uint32_t tool = 0; tool < tools.size(); ++tool) {
    for (std::size_t point = 0; point < surface.nodes.size(); ++point) {
      const Vector3 rest_m = surface.rest_m.segment<3>(at(point));
      const SurfaceDistance distance = distance_to(tools[tool].shape, poses[tool].to_tool(rest_m));
      if (distance.distance_m >= 0) continue;
      found.touches.emplace_back(tool, surface.nodes[point]);
      normals.push_back(poses[tool].orientation * distance.normal);
      gaps_m.push_back(distance.distance_m);
      Eigen::VectorXd force_n = Eigen::VectorXd::Zero(at(body.mesh().nodes.size()));
      force_n.segment<3>(at(surface.nodes[point])) = normals.back();
      moves_m.push_back(body.solve(force_n).displacement_m);
    }
  }
  const std::size_t count = found.touches.size();
  if (count == 0 || count > 10) return found;
  Eigen::MatrixXd compliance(count, count);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = 0; j < count; ++j) {
      compliance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          normals[i].dot(moves_m[j].segment<3>(at(found.touches[i].second)));
    }
  }
  const Eigen::Map<const Eigen::VectorXd> gap_m(gaps_m.data(), static_cast<Eigen::Index>(count));
  for (unsigned state = 0; state < 1U << count; ++state) {
    std::vector<Eigen::Index> rows;
    for (unsigned row = 0; row < count; ++row)
      if ((state >> row & 1U) != 0) rows.push_back(row);
    Eigen::VectorXd pressure_n = Eigen::VectorXd::Zero(gap_m.size());
    if (!rows.empty()) {
      const Eigen::MatrixXd reduced = compliance(rows, rows);
      const Eigen::VectorXd right = -gap_m(rows), solution = reduced.partialPivLu().solve(right);
      if (solution.minCoeff() < 0) continue;
      pressure_n(rows) = solution;
    }
    if ((compliance * pressure_n + gap_m).minCoeff() < -1e-13) continue;
    found.pressure_n = pressure_n;
    ++found.answers;
  }
  return found;
}

TEST(Contact, IsWhatTryingAllStatesOfRandomCasesGives) {
  std::mt19937 random(20);
  const auto number = [&](double from, double to) {
    return from + (to - from) * static_cast<double>(random()) / 4294967296.0;
  };
  std::vector<std::unique_ptr<ElasticBody>> bodies;
  std::vector<std::shared_ptr<const ContactNeighbourhood>> surfaces;
  for (const std::array<std::uint32_t, 3>& cells :
       {std::array<std::uint32_t, 3>{2, 2, 2}, {3, 2, 2}, {2, 3, 3}, {3, 3, 3}}) {
    TetMesh mesh = test::tet_grid(cells, {0.04, 0.05, 0.06});
    Constraints constraints(mesh.nodes.size());
    for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
      if (mesh.nodes[node].z() == 0) constraints.prescribe(node, Vector3::Zero(), "test");
    }
    bodies.push_back(std::make_unique<ElasticBody>(
        std::move(mesh), Materials{{0, {number(1e3, 1e5), number(0, 0.48)}}}, constraints));
    surfaces.push_back(ContactBody(*bodies.back()).whole_surface());
  }
  int compared = 0, released = 0;
  std::array<int, 6> with_fingers{};
  double worst = 0;
  for (int drawn = 0; compared < 1000; ++drawn) {
    ASSERT_LT(drawn, 20000);
    const std::size_t which = random() % bodies.size();
    const ContactNeighbourhood& surface = *surfaces[which];
    std::vector<ContactTool> tools;
    std::vector<Pose> poses;
    const std::size_t fingers = 1 + random() % 5;
    for (std::size_t i = 0; i < fingers; ++i) {
      const std::string name = "finger " + std::to_string(i + 1);
      const double size_m = number(0.006, 0.03);
      switch (random() % 3) {
        case 0:
          tools.push_back({name, Sphere{size_m}, false});
          break;
        case 1:
          tools.push_back({name, Capsule{size_m / 2, size_m}, false});
          break;
        default:
          tools.push_back({name, Box{{size_m, size_m, size_m / 4}}, false});
          break;
      }
      Pose pose = at_place(number(-0.01, 0.05), number(-0.01, 0.06), number(0.01, 0.07));
      pose.orientation =
          Eigen::Quaterniond(number(-1, 1), number(-1, 1), number(-1, 1), number(-1, 1)).normalized();
      poses.push_back(pose);
    }
    const Enumerated expected = by_enumeration(*bodies[which], surface, tools, poses);
    if (expected.touches.empty() || expected.touches.size() > 10) continue;
    ContactSolver solver(surfaces[which], tools, {1e-6, 1});
    ASSERT_EQ(expected.answers, 1) << "case " << drawn;
    const ContactResult& result = solver.step(poses);
    ++compared;
    ++with_fingers[fingers];
    Eigen::VectorXd found_n = Eigen::VectorXd::Zero(expected.pressure_n.size());
    for (const Contact& contact : result.contacts) {
      const auto place = std::ranges::find(expected.touches, std::pair(contact.tool, contact.node));
      ASSERT_NE(place, expected.touches.end());
      found_n[place - expected.touches.begin()] = contact.force_n.dot(contact.normal);
    }
    const double error = (found_n - expected.pressure_n).norm() / expected.pressure_n.norm();
    EXPECT_LE(error, 1e-8) << "case " << drawn;
    for (Eigen::Index i = 0; i < found_n.size(); ++i) {
      EXPECT_EQ(found_n[i] > 0, expected.pressure_n[i] > 0) << "case " << drawn;
      released += found_n[i] > 0 ? 0 : 1;
    }
    worst = std::max(worst, error);
  }
  EXPECT_GT(released, 500);  // states differ from all that were inside
  for (std::size_t fingers = 1; fingers <= 5; ++fingers) EXPECT_GT(with_fingers[fingers], 50);
  record("force", worst);
  testing::Test::RecordProperty("cases", compared);
}

TEST_F(ContactTest, AStickingToolTakesNodesAlongAndLetsThemGoBeforeItPulls) {
  ContactSolver solver(surface_, {{"jaw", Box{{0.002, 0.012, 0.012}}, true}});
  std::vector<Pose> poses{at_place(0.031, 0, 0.06)};
  solver.step(poses);
  expect_contact(solver, poses);
  ASSERT_FALSE(solver.result().contacts.empty());
  const std::vector<Contact> first = solver.result().contacts;
  std::vector<Vector3> on_tool;
  const auto place_of = [&](std::uint32_t node) -> Vector3 {
    const auto point = std::ranges::find(surface_->nodes, node) - surface_->nodes.begin();
    return poses[0].to_tool(solver.positions_m().segment<3>(3 * point));
  };
  for (const Contact& contact : first) on_tool.push_back(place_of(contact.node));
  // Drawn along the surface, the nodes come with it.
  poses[0].position_m += Vector3(0, 0.002, 0.001);
  poses[0].orientation = Eigen::AngleAxisd(0.05, Vector3::UnitX());
  solver.step(poses);
  expect_contact(solver, poses);
  EXPECT_GT(solver.result().tools[0].tangential_n, 0);
  std::size_t bound = 0;
  for (std::size_t i = 0; i < first.size(); ++i) {
    const bool presses = std::ranges::any_of(
        solver.result().contacts, [&](const Contact& contact) { return contact.node == first[i].node; });
    if (presses && (place_of(first[i].node) - on_tool[i]).norm() < 1e-9) ++bound;
  }
  EXPECT_GE(bound, 1U);
  // Drawn away, none is pulled.
  poses[0].position_m.x() += 0.004;
  solver.step(poses);
  expect_contact(solver, poses);
  EXPECT_TRUE(solver.result().contacts.empty());
}

TEST_F(ContactTest, StickingFollowsAsPrescribedDisplacementsDo) {
  // A tool that presses nodes in and drags them is a body with these displacements prescribed.
  ContactSolver solver(surface_, {{"finger", Sphere{0.01}, true}});
  std::vector<Pose> poses{at_place(0.0385, 0, 0.06)};
  solver.step(poses);
  poses[0].position_m += Vector3(-0.002, 0.0004, 0);
  const ContactResult& result = solver.step(poses);
  expect_contact(solver, poses);
  TetMesh mesh = body_.mesh();
  Constraints constraints(mesh.nodes.size());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (mesh.nodes[node].z() == 0) constraints.prescribe(node, Vector3::Zero(), "test");
  }
  for (const Contact& contact : result.contacts) {
    const auto point = std::ranges::find(surface_->nodes, contact.node) - surface_->nodes.begin();
    constraints.prescribe(contact.node, solver.positions_m().segment<3>(3 * point) - mesh.nodes[contact.node],
                          "finger");
  }
  const ElasticBody grasped(std::move(mesh), {{0, {1e4, 0.4}}}, constraints);
  const StaticSolution solution = grasped.solve(Eigen::VectorXd::Zero(at(body_.mesh().nodes.size())));
  double error_n = 0, largest_n = 0;
  for (const Contact& contact : result.contacts) {
    error_n =
        std::max(error_n, (solution.reaction_force_n.segment<3>(at(contact.node)) - contact.force_n).norm());
    largest_n = std::max(largest_n, contact.force_n.norm());
  }
  EXPECT_LE(error_n, 1e-9 * largest_n);
  record("force", error_n / largest_n);
}

TEST_F(ContactTest, APlateMayPressAllNodesAtOnce) {
  // A plate over the end of the cylinder, wider than it: all nodes of the end lie on it.
  ContactSolver solver(surface_, {{"plate", Box{{0.1, 0.1, 0.01}}, false}});
  const std::vector<Pose> poses{at_place(0, 0, 0.108)};
  const ContactResult& result = solver.step(poses);
  expect_contact(solver, poses);
  EXPECT_GT(result.contacts.size(), 80U);
  EXPECT_GT(result.tools[0].force_n.z(), 0);
  EXPECT_NEAR(result.tools[0].tangential_n, 0, 1e-12 * result.tools[0].normal_n);
}

TEST_F(ContactTest, WholeSurfaceInsideATool) {
  // As deep as can be: every node is inside a sphere. It must come out of it and nothing may be infinite.
  ContactSolver solver(surface_, {{"ball", Sphere{0.2}, false}}, {1e-6, 5});
  const ContactResult& result = solver.step(std::vector<Pose>{at_place(0, 0, 0.05)});
  EXPECT_LE(result.deepest_penetration_m, 1e-6 * surface_->size_m);
  EXPECT_TRUE(solver.positions_m().allFinite());
  EXPECT_TRUE(result.wrist_force_n.allFinite());
}

TEST_F(ContactTest, NothingTouchesWhereNothingIs) {
  ContactSolver solver(surface_, {fingertip("far"), fingertip("near")});
  const ContactResult& result =
      solver.step(std::vector<Pose>{at_place(1, 1, 1), at_place(0, 0.0400001, 0.05)});
  EXPECT_TRUE(result.converged);
  EXPECT_TRUE(result.contacts.empty());
  EXPECT_EQ(result.wrist_force_n, Vector3::Zero());
  EXPECT_EQ(solver.positions_m(), surface_->rest_m);
  ContactSolver toolless(surface_, {});
  EXPECT_TRUE(toolless.step({}).converged);
  ContactSolver bodiless(contact_.neighbourhood({}), {fingertip("finger")});
  EXPECT_TRUE(bodiless.step(std::vector<Pose>{at_place(0, 0.03, 0.05)}).contacts.empty());
}

TEST_F(ContactTest, TwoFingersAtOnePlaceShareItsForce) {
  const std::vector<Pose> poses(2, at_place(0.037, 0, 0.06));
  ContactSolver both(surface_, {fingertip("one"), fingertip("other")});
  const ContactResult& result = both.step(poses);
  expect_contact(both, poses);
  ContactSolver alone(surface_, {fingertip("one")});
  const Vector3 alone_n = alone.step(std::span(poses).first(1)).tools[0].force_n;
  EXPECT_LE((result.wrist_force_n - alone_n).norm(), 1e-6 * alone_n.norm());
  EXPECT_LE((result.tools[0].force_n - result.tools[1].force_n).norm(), 0.02 * alone_n.norm());
}

TEST(Contact, CoincidentNodesShareTheForce) {
  // Two blocks that lie beside each other, each with its own nodes at the same places.
  TetMesh mesh = test::tet_grid({2, 2, 3}, {0.04, 0.04, 0.06});
  const auto nodes = static_cast<std::uint32_t>(mesh.nodes.size());
  for (std::uint32_t node = 0; node < nodes; ++node) {
    Vector3 mirrored = mesh.nodes[node];
    mirrored.x() = -mirrored.x();
    mesh.nodes.push_back(mirrored);
  }
  for (std::size_t t = 0, count = mesh.tetrahedra.size(); t < count; ++t) {
    Tetrahedron corners = mesh.tetrahedra[t];
    for (std::uint32_t& node : corners) node += nodes;
    std::swap(corners[2], corners[3]);
    mesh.tetrahedra.push_back(corners);
  }
  mesh.regions.assign(mesh.tetrahedra.size(), 0);
  const ElasticBody body = held_below(std::move(mesh));
  const ContactBody contact(body);
  ContactSolver solver(contact.whole_surface(), {fingertip("finger", 0.02)});
  const std::vector<Pose> poses{at_place(0, 0.02, 0.079)};
  const ContactResult& result = solver.step(poses);
  expect_contact(solver, poses);
  ASSERT_EQ(result.contacts.size() % 2, 0U);
  EXPECT_NEAR(result.wrist_force_n.x(), 0, 1e-9 * result.wrist_force_n.norm());
}

TEST(Contact, WhatIsHeldInADirectionIsNotPressedThere) {
  TetMesh mesh = test::tet_grid({2, 2, 2}, {0.04, 0.04, 0.04});
  Constraints constraints(mesh.nodes.size());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (mesh.nodes[node].z() == 0) constraints.prescribe(node, Vector3::Zero(), "test");
    if (mesh.nodes[node].z() == 0.04) constraints.prescribe(node, 2, 0, "test");  // slides on a wall
  }
  const ElasticBody body(std::move(mesh), {{0, {1e4, 0.4}}}, constraints);
  const ContactBody contact(body);
  for (const bool sticks : {false, true}) {
    ContactSolver solver(contact.whole_surface(), {{"plate", Box{{0.1, 0.1, 0.01}}, sticks}});
    const ContactResult& result = solver.step(std::vector<Pose>{at_place(0, 0, 0.049)});
    EXPECT_TRUE(result.contacts.empty());
    EXPECT_TRUE(result.converged);
    EXPECT_TRUE(solver.positions_m().allFinite());
  }
}

TEST_F(ContactTest, RefusesToolsThatAreNoneAndLeaveNoPlace) {
  EXPECT_THROW(ContactSolver(surface_, {fingertip("finger", 0)}), UsageError);
  EXPECT_THROW(ContactSolver(surface_, {fingertip("finger")}, {0, 10}), UsageError);
  EXPECT_THROW(ContactSolver(surface_, {{"finger", Sphere{0.01}, true, 0}}), UsageError);
  EXPECT_THROW(ContactSolver(surface_, {{"finger", Sphere{0.01}, true, std::nan("")}}), UsageError);
  EXPECT_THROW(ContactSolver(surface_, {fingertip("finger")}, {1e-6, 0}), UsageError);
  ContactSolver solver(surface_,
                       {{"upper", Box{{0.1, 0.1, 0.01}}, false}, {"lower", Box{{0.1, 0.1, 0.01}}, false}});
  const std::vector<Pose> fine{at_place(0, 0, 0.109), at_place(0, 0, 0.2)};
  solver.step(fine);
  const ContactResult before = solver.result();
  const Eigen::VectorXd before_m = solver.positions_m();
  EXPECT_THROW(solver.step(std::span(fine).first(1)), UsageError);
  EXPECT_THROW(solver.step(std::vector<Pose>{at_place(0, 0, std::nan("")), fine[1]}), Error);
  try {
    solver.step(std::vector<Pose>{at_place(0, 0, 0.109), at_place(0, 0, 0.0905)});
    FAIL() << "the end lies between plates that overlap";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("leave node"));
    EXPECT_THAT(error.what(), HasSubstr("upper"));
    EXPECT_THAT(error.what(), HasSubstr("lower"));
  }
  EXPECT_EQ(solver.positions_m(), before_m);
  solver.step(fine);
  EXPECT_LE((solver.result().wrist_force_n - before.wrist_force_n).norm(),
            1e-9 * before.wrist_force_n.norm());
}

TEST_F(ContactTest, SameStepsSameBits) {
  std::array<Vector3, 2> found;
  for (Vector3& force_n : found) {
    ContactSolver solver(surface_, {{"one", Sphere{0.01}, true, 0.3}, {"two", Capsule{0.006, 0.01}, true}});
    for (int step = 0; step < 10; ++step) {
      solver.step(std::vector<Pose>{at_place(0.039 - 0.0002 * step, 0, 0.06),
                                    at_place(0, 0.035 - 0.0002 * step, 0.07 + 0.0001 * step)});
    }
    force_n = solver.result().wrist_force_n;
  }
  EXPECT_EQ(found[0], found[1]);
}

TEST_F(ContactTest, AnotherNeighbourhoodCarriesOn) {
  ContactSolver whole(surface_, {fingertip("one"), {"two", Capsule{0.006, 0.01}, true}});
  std::vector<Pose> poses{at_place(0.037, 0, 0.06), at_place(0, 0.034, 0.07)};
  whole.step(poses);
  std::vector<std::uint32_t> places;
  for (std::uint32_t place = 0; place < contact_.surface().size(); ++place) {
    if (body_.mesh().nodes[contact_.surface()[place]].z() > 0.03) places.push_back(place);
  }
  ContactSolver part(contact_.neighbourhood(places), whole.tools());
  part.continue_from(whole);
  for (std::size_t tool = 0; tool < 2; ++tool)
    EXPECT_EQ(part.result().tools[tool].force_n, whole.result().tools[tool].force_n);
  poses[1].position_m.x() += 0.0005;
  whole.step(poses);
  part.step(poses);
  for (std::size_t tool = 0; tool < 2; ++tool) {
    const Vector3& expected_n = whole.result().tools[tool].force_n;
    EXPECT_LE((part.result().tools[tool].force_n - expected_n).norm(), 1e-6 * expected_n.norm());
  }
}

TEST_F(ContactTest, ALargerNeighbourhoodIsAsBeforeUnlessItsNodesArePressed) {
  const std::vector<ContactTool> tools{fingertip("one"), {"two", Capsule{0.006, 0.01}, true}};
  const std::vector<Pose> poses{at_place(0.037, 0, 0.06), at_place(0, 0.034, 0.07)};
  const auto solver_where = [&](auto known) {
    std::vector<std::uint32_t> places;
    for (std::uint32_t place = 0; place < contact_.surface().size(); ++place) {
      if (known(contact_.surface()[place])) places.push_back(place);
    }
    return ContactSolver(contact_.neighbourhood(places), tools);
  };
  ContactSolver part = solver_where([&](std::uint32_t node) { return body_.mesh().nodes[node].z() > 0.03; });
  part.step(poses);
  ContactSolver more(surface_, tools);
  EXPECT_TRUE(more.continue_from(part));
  Eigen::VectorXd expected_m = surface_->rest_m;
  for (const Contact& contact : part.result().contacts) {
    const auto point = std::ranges::find(surface_->nodes, contact.node) - surface_->nodes.begin();
    expected_m += surface_->compliance.middleCols<3>(3 * point) * contact.force_n;
  }
  EXPECT_LE((more.positions_m() - expected_m).lpNorm<Eigen::Infinity>(), 1e-15 * surface_->size_m);
  // From there on both find the same.
  const Vector3 expected_n = part.step(poses).wrist_force_n;
  EXPECT_LE((more.step(poses).wrist_force_n - expected_n).norm(), 1e-9 * expected_n.norm());
  expect_contact(more, poses);

  // One of the nodes that is pressed was not known, and what did not know it goes into it.
  const std::uint32_t pressed = more.result().contacts[0].node;
  ContactSolver without = solver_where([&](std::uint32_t node) { return node != pressed; });
  without.step(poses);
  EXPECT_FALSE(more.continue_from(without));
  more.step(poses);
  expect_contact(more, poses);
  // The other way round its contact is lost, and where it was is no balance.
  EXPECT_FALSE(without.continue_from(more));
}

TEST(Contact, WeightActsBesideContact) {
  const ElasticBody body = held_below(test::tet_cylinder(3, 5, 0.03, 0.1));
  const Eigen::VectorXd weight_n = body.weight_n({0, 0, -9.81});
  const ContactBody contact(body, weight_n);
  Eigen::VectorXd displacement_m;
  contact.displacement_m({}, displacement_m);
  EXPECT_EQ(displacement_m, body.solve(weight_n).displacement_m);
  for (std::size_t i = 0; i < contact.surface().size(); ++i) {
    const std::uint32_t node = contact.surface()[i];
    EXPECT_EQ(contact.whole_surface()->rest_m.segment<3>(at(i)),
              displacement_m.segment<3>(at(node)) + body.mesh().nodes[node]);
  }
  EXPECT_THROW(ContactBody(body, Eigen::VectorXd::Zero(3)), UsageError);
  EXPECT_THROW((void)contact.place_of(0), Error);
}

}  // namespace
}  // namespace kiroku::sim
