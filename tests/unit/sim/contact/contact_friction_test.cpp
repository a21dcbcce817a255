// Coulomb friction of tools that stick: its cone, its limits, and what all states tried give.
#include <cmath>
#include <limits>
#include <random>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "tests/support/contact_kit.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using namespace test;  // NOLINT(google-build-using-namespace): the kit

/// Of a contact, along the tool's surface.
Vector3 across_n(const Contact& contact) {
  return contact.force_n - contact.force_n.dot(contact.normal) * contact.normal;
}

TEST_F(ContactTest, FrictionHoldsUpToItsConeThenSlidesAtIt) {
  // A plate presses the cylinder's end and is drawn sideways.
  constexpr double kFriction = 0.3;
  ContactTool plate{"plate", Box{{0.1, 0.1, 0.01}}, true, kFriction};
  ContactSolver solver(surface_, {plate});
  std::vector<Pose> poses{at_place(0, 0, 0.1095)};
  solver.step(poses);
  double last_share = 0, steepest = 0, last_n = solver.result().tools[0].force_n.norm();
  const double first_n = last_n;
  bool stuck = false;
  for (int step = 0; step < 60; ++step) {
    poses[0].position_m.x() += 2e-4;
    const ContactResult& result = solver.step(poses);
    expect_contact(solver, poses);
    for (const Contact& contact : result.contacts) {
      EXPECT_LE(across_n(contact).norm(),
                kFriction * contact.force_n.dot(contact.normal) + 1e-3 * result.tools[0].force_n.norm());
    }
    last_share = result.tools[0].tangential_n / result.tools[0].normal_n;
    stuck = stuck || (last_share > 0.01 && last_share < 0.2);
    steepest = std::max(steepest, std::abs(result.tools[0].force_n.norm() - last_n));
    last_n = result.tools[0].force_n.norm();
  }
  EXPECT_TRUE(stuck);
  // All nodes slide the same way, so the whole plate feels Coulomb's law.
  EXPECT_NEAR(last_share, kFriction, 0.05 * kFriction);
  EXPECT_LT(steepest, 0.05 * first_n);  // no jump where it begins to slide
  record("share", last_share);
  // Drawn back it is held again, at first by what it slid with, and slides the other way in the end.
  const double sliding_n = solver.result().tools[0].force_n.x();
  EXPECT_LT(sliding_n, 0);
  for (int step = 0; step < 120; ++step) {
    poses[0].position_m.x() -= 2e-4;
    solver.step(poses);
  }
  EXPECT_NEAR(solver.result().tools[0].force_n.x(), -sliding_n, 0.05 * std::abs(sliding_n));
}

TEST_F(ContactTest, FrictionLeavesTheForcesOfAToolThatStaysAsTheyAre) {
  ContactSolver solver(surface_, {{"finger", Sphere{0.01}, true, 0.4}});
  std::vector<Pose> poses{at_place(0.038, 0, 0.06)};
  solver.step(poses);
  for (int step = 0; step < 20; ++step) {
    poses[0].position_m += Vector3(-1e-4, 2e-4, 1e-4);
    solver.step(poses);
  }
  const Vector3 moved_n = solver.result().tools[0].force_n;
  EXPECT_GT(solver.result().tools[0].tangential_n, 0.05 * moved_n.norm());
  for (int step = 0; step < 5; ++step) solver.step(poses);
  EXPECT_LE((solver.result().tools[0].force_n - moved_n).norm(), 2e-3 * moved_n.norm());
}

TEST_F(ContactTest, HardlyAnyFrictionGlidesAndVeryMuchSticks) {
  const auto dragged = [&](const ContactTool& tool) {
    ContactSolver solver(surface_, {tool});
    std::vector<Pose> poses{at_place(0.0385, 0, 0.06)};
    solver.step(poses);
    for (int step = 0; step < 10; ++step) {
      poses[0].position_m += Vector3(-1e-4, 5e-5, 0);
      solver.step(poses);
    }
    return solver.result().tools[0].force_n;
  };
  const Vector3 glides_n = dragged({"finger", Sphere{0.01}}),
                sticks_n = dragged({"finger", Sphere{0.01}, true});
  EXPECT_LE((dragged({"finger", Sphere{0.01}, true, 1e-7}) - glides_n).norm(), 1e-5 * glides_n.norm());
  EXPECT_LE((dragged({"finger", Sphere{0.01}, true, 1e7}) - sticks_n).norm(), 1e-9 * sticks_n.norm());
  EXPECT_GT((sticks_n - glides_n).norm(), 0.01 * glides_n.norm());
}

TEST(Contact, FrictionIsWhatTryingAllStatesGives) {
  // A plate drawn over random blocks: nodes are open, stuck or sliding. All 3^n states are solved densely,
  // friction as an unknown of its own (no iteration, no symmetric matrix), along the directions that were
  // found; one that fits is the solver's. The directions oppose the slip.
  std::mt19937 random(7);
  const auto number = [&](double from, double to) {
    return from + (to - from) * static_cast<double>(random()) / 4294967296.0;
  };
  int compared = 0, sliding = 0, stuck = 0, opened = 0, all_backwards = 0;
  double worst = 0;
  for (int drawn = 0; compared < 60; ++drawn) {
    ASSERT_LT(drawn, 2000);
    TetMesh mesh = test::tet_grid({2, 2, 2}, {0.04, 0.05, 0.06});
    Constraints constraints(mesh.nodes.size());
    for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
      if (mesh.nodes[node].z() == 0) constraints.prescribe(node, Vector3::Zero(), "test");
    }
    const ElasticBody body(std::move(mesh), {{0, {number(1e3, 1e5), number(0, 0.45)}}}, constraints);
    const ContactBody contact(body);
    const auto surface = contact.whole_surface();
    const double friction = number(0.1, 0.8), half_m = number(0.012, 0.03);
    const ContactTool plate{"plate", Box{{half_m, half_m, 0.005}}, true, friction};
    ContactSolver solver(surface, {plate});
    std::vector<Pose> poses{at_place(number(0, 0.04), number(0, 0.05), 0.0645)};
    poses[0].orientation = Eigen::AngleAxisd(number(-0.1, 0.1), Vector3::UnitX());
    solver.step(poses);
    const std::vector<Contact> before = solver.result().contacts;
    if (before.empty() || before.size() > 6) continue;
    // Where they are on the plate is where friction holds them.
    std::vector<Eigen::Index> points;
    std::vector<Vector3> anchors;
    for (const Contact& each : before) {
      points.push_back(std::ranges::find(surface->nodes, each.node) - surface->nodes.begin());
      anchors.push_back(poses[0].to_tool(solver.positions_m().segment<3>(3 * points.back())));
    }
    poses[0].position_m += Vector3(number(-1, 1), number(-1, 1), number(-0.4, 0.2)) * 1e-3;
    const ContactResult& result = solver.step(poses);
    expect_contact(solver, poses);
    if (result.contacts.size() > before.size()) continue;
    const auto is_new = [&](const Contact& each) {
      return std::ranges::none_of(before, [&](const Contact& old) { return old.node == each.node; });
    };
    if (std::ranges::any_of(result.contacts, is_new)) continue;
    const Eigen::Matrix3d turned = poses[0].orientation.toRotationMatrix();
    const Vector3 normal = -turned.col(2);
    // What comes to lie at the plate's rim has another plane.
    const auto is_at_rim = [&](const Vector3& anchor_m) {
      return anchor_m.head<2>().cwiseAbs().maxCoeff() > half_m - 0.0015;
    };
    if (std::ranges::any_of(anchors, is_at_rim)) continue;
    ++compared;
    const auto count = static_cast<Eigen::Index>(points.size());
    Eigen::MatrixXd compliance(3 * count, 3 * count);
    Eigen::VectorXd rest_m(3 * count), found_n = Eigen::VectorXd::Zero(3 * count);
    std::vector<Vector3> along(points.size(), Vector3::Zero()), on_plate_m;
    for (Eigen::Index i = 0; i < count; ++i) {
      const auto number_of = static_cast<std::size_t>(i);
      for (Eigen::Index j = 0; j < count; ++j) {
        compliance.block<3, 3>(3 * i, 3 * j) =
            surface->compliance.block<3, 3>(3 * points[number_of], 3 * points[static_cast<std::size_t>(j)]);
      }
      rest_m.segment<3>(3 * i) = surface->rest_m.segment<3>(3 * points[number_of]);
      on_plate_m.emplace_back(poses[0].position_m + turned * anchors[number_of]);
      const auto pressed = std::ranges::find(result.contacts, before[number_of].node, &Contact::node);
      if (pressed == result.contacts.end()) continue;
      found_n.segment<3>(3 * i) = pressed->force_n;
      along[number_of] = across_n(*pressed).stableNormalized();
    }
    int answers = 0;
    const auto states = static_cast<int>(std::lround(std::pow(3, count)));
    for (int state = 0; state < states; ++state) {
      // Of each node: 0 open, 1 stuck, 2 sliding.
      std::vector<int> is(points.size());
      for (int i = 0, rest = state; i < count; ++i, rest /= 3) is[static_cast<std::size_t>(i)] = rest % 3;
      // Unknown: all forces. Rows: none; the place on the plate; the plane, and friction by the normal force.
      Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(3 * count, 3 * count);
      Eigen::VectorXd right = Eigen::VectorXd::Zero(3 * count);
      for (Eigen::Index i = 0; i < count; ++i) {
        const auto at_i = static_cast<std::size_t>(i);
        const Vector3 gap_m = on_plate_m[at_i] - rest_m.segment<3>(3 * i);
        if (is[at_i] == 0) {
          matrix.block<3, 3>(3 * i, 3 * i).setIdentity();
        } else if (is[at_i] == 1) {
          matrix.middleRows<3>(3 * i) = compliance.middleRows<3>(3 * i) * 1e3;
          right.segment<3>(3 * i) = gap_m * 1e3;
        } else {
          matrix.row(3 * i) = normal.transpose() * compliance.middleRows<3>(3 * i) * 1e3;
          right[3 * i] = normal.dot(gap_m) * 1e3;
          const Vector3 one = turned.col(0), other = turned.col(1);
          matrix.block<1, 3>(3 * i + 1, 3 * i) = (one - friction * one.dot(along[at_i]) * normal).transpose();
          matrix.block<1, 3>(3 * i + 2, 3 * i) =
              (other - friction * other.dot(along[at_i]) * normal).transpose();
        }
      }
      const Eigen::VectorXd force_n = matrix.fullPivLu().solve(right);
      const Eigen::VectorXd moved_m = compliance * force_n;
      bool fits = true;
      int backwards = 0;
      const double rounding_n = 1e-3 * force_n.cwiseAbs().maxCoeff();
      for (Eigen::Index i = 0; i < count && fits; ++i) {
        const auto at_i = static_cast<std::size_t>(i);
        const Vector3 own_n = force_n.segment<3>(3 * i);
        const double normal_n = own_n.dot(normal);
        const Vector3 gap_m = rest_m.segment<3>(3 * i) + moved_m.segment<3>(3 * i) - on_plate_m[at_i];
        if (is[at_i] == 0) fits = gap_m.dot(normal) >= -1e-9;
        if (is[at_i] == 1)
          fits = normal_n >= 0 && (own_n - normal_n * normal).norm() <= friction * normal_n + rounding_n;
        if (is[at_i] == 2) fits = normal_n >= 0;
        // It is to move over the plate against the way friction acts.
        if (is[at_i] == 2 && gap_m.dot(along[at_i]) >= 0) ++backwards;
      }
      if (!fits) continue;
      const double error = (force_n - found_n).norm() / found_n.norm();
      if (error > 5e-3) continue;
      ++answers;
      worst = std::max(worst, error);
      all_backwards += backwards;
      for (const int each : is) {
        opened += each == 0 ? 1 : 0;
        stuck += each == 1 ? 1 : 0;
        sliding += each == 2 ? 1 : 0;
      }
      break;
    }
    EXPECT_EQ(answers, 1) << "case " << drawn;
  }
  EXPECT_GT(sliding, 30);
  // What slid in a step that would have held it in the end slides on: seldom.
  EXPECT_LE(all_backwards, sliding / 20);
  EXPECT_GT(stuck, 30);
  EXPECT_GT(opened, 5);
  record("force", worst);
}

TEST_F(ContactTest, FrictionNeverTurnsAPinchIntoNoPlace) {
  // Two fingers press the same nodes from two sides and are drawn apart: none of the tools holds them.
  ContactSolver solver(surface_, {{"one", Sphere{0.01}, true, 0.5}, {"other", Sphere{0.01}, true, 0.5}});
  std::vector<Pose> poses{at_place(0.036, 0.004, 0.06), at_place(0.036, -0.004, 0.06)};
  for (int step = 0; step < 30; ++step) {
    poses[0].position_m += Vector3(-1e-4, 3e-4, 0);
    poses[1].position_m += Vector3(-1e-4, step < 15 ? 3e-4 : -6e-4, 0);
    const ContactResult& result = solver.step(poses);
    expect_contact(solver, poses);
    EXPECT_LT(result.wrist_force_n.norm(), 100);
  }
}

}  // namespace
}  // namespace kiroku::sim
