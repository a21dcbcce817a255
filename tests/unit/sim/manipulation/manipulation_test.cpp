// What tools hold and press is what a body with these displacements prescribed, and a factor of its own,
// gives.
#include "sim/manipulation/manipulation.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/mesh/degrees_of_freedom.h"
#include "tests/support/tet_cylinder.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr double kRadius_m = 0.03, kLength_m = 0.1;

void record_elastic(const char* what, double figure) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1e", figure);
  testing::Test::RecordProperty(what, text);
}

Constraints held_below(const TetMesh& mesh) {
  Constraints constraints(mesh.nodes.size());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (mesh.nodes[node].z() == 0) constraints.prescribe(node, Vector3::Zero(), "test");
  }
  return constraints;
}

Materials tissue() { return {{0, {1e4, 0.4, 1060}}}; }

Pose at_place(double x, double y, double z) {
  Pose pose;
  pose.position_m = {x, y, z};
  return pose;
}

Pose turned(Pose pose, double radian, const Vector3& axis) {
  pose.orientation = Eigen::AngleAxisd(radian, axis.normalized()) * pose.orientation;
  return pose;
}

std::string message_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

/// A clamped cylinder under its weight.
struct Organ {
  TetMesh mesh = test::tet_cylinder(4, 7, kRadius_m, kLength_m);
  ElasticBody body{mesh, tissue(), held_below(mesh)};
  Eigen::VectorXd weight_n = body.weight_n({1, 0, -9.81});
  ContactBody contact{body, weight_n};
};

/// The same with nodes prescribed where their tools take them, by a factor of its own.
class Prescribed {
 public:
  Prescribed(const TetMesh& mesh, Constraints constraints)
      : mesh_(mesh), constraints_(std::move(constraints)) {}

  /// What a tool that was at `from` when nodes had `displacement_m` does when it goes to `to`.
  void carry(const std::vector<std::uint32_t>& nodes, const Eigen::VectorXd& displacement_m, const Pose& from,
             const Pose& to) {
    for (const std::uint32_t node : nodes) {
      const Vector3 grasped_m = mesh_.nodes[node] + displacement_m.segment<3>(first_row(node));
      const Vector3 moved_m = to.from_tool(from.to_tool(grasped_m)) - mesh_.nodes[node];
      for (std::size_t component = 0; component < 3; ++component) {
        if (!constraints_.prescribed(3 * node + component))
          constraints_.prescribe(node, component, moved_m[static_cast<Eigen::Index>(component)], "tool");
      }
    }
  }
  [[nodiscard]] ElasticBody body() const { return {mesh_, tissue(), constraints_}; }

 private:
  TetMesh mesh_;
  Constraints constraints_;
};

std::vector<std::uint32_t> nodes_of(const ManipulationResult& result, std::uint32_t tool) {
  std::vector<std::uint32_t> nodes;
  for (const BoundNode& held : result.bound) {
    if (held.tool == tool) nodes.push_back(held.node);
  }
  return nodes;
}

double largest(const Eigen::VectorXd& vector) { return vector.cwiseAbs().maxCoeff(); }

/// Displacements, and forces on what is held, against those of a body with it prescribed; relative to the
/// largest.
void expect_as(const StaticSolution& expected, const Manipulation& manipulation, double bound,
               const char* name = nullptr) {
  const double of_displacement =
      largest(manipulation.displacement_m() - expected.displacement_m) / largest(expected.displacement_m);
  EXPECT_LE(of_displacement, bound);
  double error_n = 0, largest_n = 0;
  for (const BoundNode& held : manipulation.result().bound) {
    const Vector3 reaction_n = expected.reaction_force_n.segment<3>(first_row(held.node));
    error_n = std::max(error_n, (held.force_n - reaction_n).norm());
    largest_n = std::max(largest_n, reaction_n.norm());
  }
  EXPECT_LE(error_n, bound * largest_n);
  if (name == nullptr) return;
  record_elastic((std::string(name) + "_displacement").c_str(), of_displacement);
  record_elastic((std::string(name) + "_force").c_str(), error_n / largest_n);
}

/// The forces of tools are the reactions of what they hold, and their torques, and with what is fixed and the
/// weight they are in equilibrium.
void expect_balance(const Organ& organ, const Manipulation& manipulation,
                    std::span<const OptionalPose> poses) {
  const Eigen::VectorXd tools_n = manipulation.tool_force_n();
  const StaticSolution solution = organ.body.solve(organ.weight_n + tools_n);
  const Eigen::VectorXd displacement_m = manipulation.displacement_m();
  const double scale_n = tools_n.norm() + organ.weight_n.norm();
  EXPECT_LE(largest(solution.displacement_m - displacement_m), 1e-9 * largest(displacement_m));
  Vector3 sum_n = Vector3::Zero(), sum_nm = Vector3::Zero();
  for (std::size_t node = 0; node < organ.mesh.nodes.size(); ++node) {
    const Vector3 fixed_n =
        solution.reaction_force_n.segment<3>(first_row(node)) + organ.weight_n.segment<3>(first_row(node));
    sum_n += fixed_n;
    // Linear elasticity balances moments about where nodes were.
    sum_nm += organ.mesh.nodes[node].cross(Vector3(fixed_n + tools_n.segment<3>(first_row(node))));
  }
  Vector3 felt_n = Vector3::Zero(), moved_nm = Vector3::Zero(), felt_nm = Vector3::Zero();
  for (std::size_t tool = 0; tool < poses.size(); ++tool) {
    const ToolForce& feels = manipulation.result().tools[tool];
    felt_n += feels.force_n;
    if (poses[tool]) felt_nm += feels.torque_nm + poses[tool]->position_m.cross(feels.force_n);
  }
  for (std::size_t node = 0; node < organ.mesh.nodes.size(); ++node) {
    const Vector3 now_m = organ.mesh.nodes[node] + displacement_m.segment<3>(first_row(node));
    moved_nm += now_m.cross(Vector3(tools_n.segment<3>(first_row(node))));
  }
  EXPECT_LE((sum_n - felt_n).norm(), 1e-9 * scale_n);
  EXPECT_LE(sum_nm.norm(), 1e-9 * scale_n * kLength_m);
  EXPECT_LE((felt_nm + moved_nm).norm(), 1e-9 * scale_n * kLength_m);
  EXPECT_LE((manipulation.result().wrist_force_n - felt_n).norm(), 1e-12 * scale_n);
}

const Vector3 kJaws_m{0.012, 0.012, 0.012};

TEST(Manipulation, AGraspIsAPrescribedMotion) {
  const Organ organ;
  Manipulation manipulation(organ.contact, {forceps("forceps", kJaws_m)});
  EXPECT_EQ(manipulation.displacement_m(), organ.body.solve(organ.weight_n).displacement_m);
  const Pose from = turned(at_place(kRadius_m, 0, 0.09), 0.3, {1, 2, 3});
  const std::size_t count = manipulation.grasp(0, from);
  EXPECT_GT(count, 4U);
  EXPECT_EQ(manipulation.held_by(0), count);
  const Eigen::VectorXd at_grasp_m = manipulation.displacement_m();
  // Far, and turned by more than a right angle.
  const Pose to = turned(at_place(0.05, 0.03, 0.11), 2.1, {-1, 2, 1});
  const std::vector<OptionalPose> poses{to};
  const ManipulationResult& result = manipulation.step(poses);
  EXPECT_TRUE(result.converged);
  const std::vector<std::uint32_t> nodes = nodes_of(result, 0);
  ASSERT_EQ(nodes.size(), count);
  Prescribed prescribed(organ.mesh, held_below(organ.mesh));
  prescribed.carry(nodes, at_grasp_m, from, to);
  expect_as(prescribed.body().solve(organ.weight_n), manipulation, 1e-9, "one_tool");
  expect_balance(organ, manipulation, poses);
}

TEST(Manipulation, ThreeToolsGraspAndReleaseInAnyOrder) {
  const Organ organ;
  Manipulation manipulation(organ.contact,
                            {forceps("left", kJaws_m), pin("pin", 0.015), forceps("right", kJaws_m)});
  const std::array<Pose, 3> from{at_place(kRadius_m, 0, 0.09), at_place(0, -kRadius_m, 0.05),
                                 turned(at_place(-0.02, 0.02, 0.1), 0.5, {0, 0, 1})};
  const std::array<Pose, 3> to{turned(at_place(0.035, 0.005, 0.095), 0.4, {1, 1, 0}),
                               turned(at_place(0.002, -0.037, 0.052), -0.6, {0, 1, 3}),
                               turned(at_place(-0.03, 0.02, 0.11), 0.9, {0, 0, 1})};
  std::array<Eigen::VectorXd, 3> at_grasp_m;
  std::array<std::vector<std::uint32_t>, 3> nodes;
  std::vector<OptionalPose> poses(3);
  const auto expect_held = [&](std::initializer_list<std::size_t> tools, const char* name = nullptr) {
    Prescribed prescribed(organ.mesh, held_below(organ.mesh));
    for (const std::size_t tool : tools)
      prescribed.carry(nodes[tool], at_grasp_m[tool], from[tool], *poses[tool]);
    expect_as(prescribed.body().solve(organ.weight_n), manipulation, 1e-9, name);
    expect_balance(organ, manipulation, poses);
  };
  const auto grasp = [&](std::size_t tool) {
    manipulation.grasp(tool, from[tool]);
    at_grasp_m[tool] = manipulation.displacement_m();
    poses[tool] = to[tool];
    manipulation.step(poses);
    nodes[tool] = nodes_of(manipulation.result(), static_cast<std::uint32_t>(tool));
    ASSERT_EQ(nodes[tool].size(), manipulation.held_by(tool));
  };
  grasp(1);
  expect_held({1});
  grasp(0);
  expect_held({0, 1});
  grasp(2);
  expect_held({0, 1, 2}, "three_tools");
  // The one in the middle, then the first; what is open may be anywhere, or nowhere.
  manipulation.release(0);
  EXPECT_EQ(manipulation.held_by(0), 0U);
  poses[0].reset();
  manipulation.step(poses);
  expect_held({1, 2});
  manipulation.release(1);
  manipulation.step(poses);
  expect_held({2});
  poses[2]->position_m.x() += 0.004;
  manipulation.step(poses);
  expect_held({2});
  EXPECT_EQ(manipulation.result().tools[0].force_n, Vector3::Zero());
  EXPECT_EQ(manipulation.result().tools[1].nodes, 0U);
  manipulation.release(2);
  manipulation.step(std::vector<OptionalPose>(3));
  const Eigen::VectorXd rest_m = organ.body.solve(organ.weight_n).displacement_m;
  EXPECT_LE(largest(manipulation.displacement_m() - rest_m), 1e-9 * largest(rest_m));
  EXPECT_TRUE(manipulation.result().bound.empty());
  EXPECT_EQ(manipulation.result().wrist_force_n, Vector3::Zero());
}

TEST(Manipulation, NodesThatAreHeldInADirectionFollowInTheOthers) {
  const TetMesh mesh = test::tet_grid({3, 3, 4}, {0.03, 0.03, 0.04});
  Constraints constraints = held_below(mesh);
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node) {
    if (mesh.nodes[node].x() == 0 && mesh.nodes[node].z() > 0) constraints.prescribe(node, 0, 0.001, "wall");
    if (mesh.nodes[node].y() == 0 && mesh.nodes[node].z() == 0.04) constraints.prescribe(node, 2, 0, "floor");
  }
  const ElasticBody body(mesh, tissue(), constraints);
  const ContactBody contact(body);
  Manipulation manipulation(contact, {forceps("forceps", {0.02, 0.02, 0.015})});
  const Pose from = at_place(0.01, 0.01, 0.04), to = turned(at_place(0.012, 0.009, 0.045), 0.2, {1, 1, 1});
  manipulation.grasp(0, from);
  const Eigen::VectorXd at_grasp_m = manipulation.displacement_m();
  manipulation.step(std::vector<OptionalPose>{to});
  Prescribed prescribed(mesh, constraints);
  prescribed.carry(nodes_of(manipulation.result(), 0), at_grasp_m, from, to);
  const StaticSolution expected =
      prescribed.body().solve(Eigen::VectorXd::Zero(first_row(mesh.nodes.size())));
  EXPECT_LE(largest(manipulation.displacement_m() - expected.displacement_m),
            1e-9 * largest(expected.displacement_m));
  double largest_n = 0;
  for (const BoundNode& held : manipulation.result().bound)
    largest_n = std::max(largest_n, held.force_n.norm());
  std::size_t slid = 0;
  for (const BoundNode& held : manipulation.result().bound) {
    for (std::size_t component = 0; component < 3; ++component) {
      const auto i = static_cast<Eigen::Index>(component);
      // What is prescribed is held by what prescribes it, the rest by the tool.
      const bool of_wall = constraints.prescribed(3 * held.node + component);
      const double expected_n = of_wall ? 0 : expected.reaction_force_n[first_row(held.node) + i];
      EXPECT_NEAR(held.force_n[i], expected_n, 1e-9 * largest_n);
      slid += of_wall ? 1 : 0;
    }
  }
  EXPECT_GT(slid, 4U);
}

TEST(Manipulation, AGraspMovesNothing) {
  const Organ organ;
  Manipulation manipulation(
      organ.contact, {forceps("forceps", kJaws_m), finger("finger", 0.01, true), forceps("second", kJaws_m)});
  manipulation.grasp(0, at_place(kRadius_m, 0, 0.09));
  std::vector<OptionalPose> poses{turned(at_place(0.036, 0.002, 0.093), 0.3, {0, 1, 1}),
                                  at_place(0, 0.036, 0.06), std::nullopt};
  manipulation.step(poses);
  ASSERT_FALSE(manipulation.result().contacts.empty());
  const Eigen::VectorXd before_m = manipulation.displacement_m();
  const ManipulationResult before = manipulation.result();
  // Beside the finger and under it: nodes that it presses change hands.
  poses[2] = turned(at_place(0.002, 0.025, 0.055), 0.7, {1, 0, 2});
  manipulation.grasp(2, *poses[2]);
  EXPECT_EQ(manipulation.displacement_m(), before_m);
  manipulation.step(poses);
  const Eigen::VectorXd after_m = manipulation.displacement_m();
  EXPECT_LE(largest(after_m - before_m), 1e-9 * largest(before_m));
  record_elastic("jump", largest(after_m - before_m) / largest(before_m));
  const ManipulationResult& after = manipulation.result();
  EXPECT_LT(after.contacts.size(), before.contacts.size());
  EXPECT_LE((after.wrist_force_n - before.wrist_force_n).norm(), 1e-9 * before.wrist_force_n.norm());
  EXPECT_LE((after.tools[0].force_n - before.tools[0].force_n).norm(), 1e-9 * before.tools[0].force_n.norm());
  expect_balance(organ, manipulation, poses);
}

TEST(Manipulation, ContactsWhileHeldAreThoseOfABodyWithItsNodesPrescribed) {
  const Organ organ;
  Manipulation manipulation(organ.contact,
                            {forceps("forceps", kJaws_m), pin("pin", 0.015), finger("finger", 0.01),
                             flat_retractor("blade", {0.003, 0.015, 0.015}), hook("hook", 0.004, 0.02)});
  const Pose forceps_from = at_place(kRadius_m, 0, 0.09), pin_from = at_place(0, -kRadius_m, 0.08);
  manipulation.grasp(0, forceps_from);
  manipulation.grasp(1, pin_from);
  const Eigen::VectorXd at_grasp_m = manipulation.displacement_m();
  const std::vector<OptionalPose> poses{turned(at_place(0.033, 0.002, 0.092), 0.2, {0, 1, 1}),
                                        turned(at_place(0, -0.033, 0.081), 0.3, {1, 0, 0}),
                                        at_place(0.002, 0.037, 0.07), at_place(-0.027, 0, 0.06),
                                        turned(at_place(0.02, 0.026, 0.045), 1.2, {0, 1, 0})};
  manipulation.step(poses);
  const ManipulationResult& result = manipulation.result();
  EXPECT_TRUE(result.converged);
  EXPECT_LE(result.deepest_penetration_m, 1e-6 * kLength_m);
  for (std::uint32_t tool = 0; tool < 5; ++tool) EXPECT_GT(result.tools[tool].nodes, 0U) << tool;
  Prescribed prescribed(organ.mesh, held_below(organ.mesh));
  prescribed.carry(nodes_of(result, 0), at_grasp_m, forceps_from, *poses[0]);
  prescribed.carry(nodes_of(result, 1), at_grasp_m, pin_from, *poses[1]);
  const ElasticBody body = prescribed.body();
  const ContactBody contact(body, organ.weight_n);
  ContactSolver direct(
      contact.whole_surface(),
      {{"finger", Sphere{0.01}}, {"blade", Box{{0.003, 0.015, 0.015}}}, {"hook", Capsule{0.004, 0.02}}});
  const ContactResult& expected = direct.step(std::vector<Pose>{*poses[2], *poses[3], *poses[4]});
  EXPECT_TRUE(expected.converged);
  Eigen::VectorXd expected_m;
  contact.displacement_m(expected.contacts, expected_m);
  const double error_m = largest(expected_m - manipulation.displacement_m());
  EXPECT_LE(error_m, 1e-6 * kLength_m);
  record_elastic("displacement_of_size", error_m / kLength_m);
  for (std::size_t tool = 0; tool < 3; ++tool) {
    const ToolForce& found = result.tools[tool + 2];
    EXPECT_LE((found.force_n - expected.tools[tool].force_n).norm(),
              1e-4 * expected.tools[tool].force_n.norm());
    EXPECT_EQ(found.nodes, expected.tools[tool].nodes);
    EXPECT_NEAR(found.normal_n, expected.tools[tool].normal_n, 1e-4 * expected.tools[tool].normal_n);
  }
  // And to the last bits but some, the forces found are those that give these displacements.
  expect_balance(organ, manipulation, poses);
}

TEST(Manipulation, StepsWithColumnsOnDemandAreThoseOfTheWholeSurface) {
  const TetMesh mesh = test::tet_cylinder(5, 8, kRadius_m, kLength_m);
  const ElasticBody body(mesh, {{0, {1e4, 0.4}}}, held_below(mesh));
  const ContactBody all(body);
  // So little memory that columns come and go.
  const ContactBody small(body, {}, {2, std::size_t{200} << 10});
  ASSERT_FALSE(small.compliance().complete());
  const std::vector<Tool> tools{finger("one", 0.01), finger("two", 0.01),
                                flat_retractor("jaw", {0.002, 0.01, 0.01}, true)};
  std::vector<ContactTool> solids;
  for (const Tool& tool : tools)
    solids.push_back({tool.name, tool.shape, tool.action == ToolAction::kSticks});
  ContactSolver whole(all.whole_surface(), solids);
  Manipulation manipulation(small, tools);
  const double size_m = all.whole_surface()->size_m;
  for (int step = 0; step <= 20; ++step) {
    const double in_m = 0.0003 * step;
    const std::vector<Pose> poses{at_place(0.041 - in_m, 0.001 * step, 0.06),
                                  at_place(-0.041 + in_m, 0, 0.08 - 0.001 * step),
                                  at_place(0.0002 * step, 0.033 - in_m, 0.05)};
    const ContactResult& expected = whole.step(poses);
    const ManipulationResult& found =
        manipulation.step(std::vector<OptionalPose>(poses.begin(), poses.end()));
    EXPECT_TRUE(found.converged);
    EXPECT_LE(found.deepest_penetration_m, 1e-6 * size_m);
    for (std::size_t tool = 0; tool < tools.size(); ++tool) {
      EXPECT_LE((found.tools[tool].force_n - expected.tools[tool].force_n).norm(),
                1e-4 * (1e-3 + expected.tools[tool].force_n.norm()))
          << step << " " << tool;
    }
  }
  EXPECT_LT(small.compliance().usage().groups_computed, 1000U);
  Eigen::VectorXd expected_m;
  all.displacement_m(whole.result().contacts, expected_m);
  EXPECT_LE((manipulation.displacement_m() - expected_m).norm(), 1e-4 * expected_m.norm());
}

TEST(Manipulation, TissueThatIsPulledIntoASolidIsPressed) {
  const Organ organ;
  Manipulation manipulation(organ.contact,
                            {forceps("forceps", kJaws_m), flat_retractor("blade", {0.002, 0.04, 0.06})});
  manipulation.grasp(0, at_place(kRadius_m, 0, 0.09));
  std::vector<OptionalPose> poses{std::nullopt, at_place(-0.036, 0, 0.05)};
  for (int step = 0; step <= 10; ++step) {
    poses[0] = at_place(kRadius_m - 0.002 * step, 0, 0.09);
    const ManipulationResult& result = manipulation.step(poses);
    EXPECT_TRUE(result.converged);
    EXPECT_LE(result.deepest_penetration_m, 1e-6 * kLength_m);
    expect_balance(organ, manipulation, poses);
  }
  EXPECT_GT(manipulation.result().tools[1].normal_n, 0);
  EXPECT_LT(manipulation.result().tools[1].force_n.x(), 0);
  manipulation.release(0);
  manipulation.step(poses);
  EXPECT_TRUE(manipulation.result().contacts.empty());
}

TEST(Manipulation, OtherToolsComeAndGoWhileOneSticks) {
  const Organ organ;
  const std::vector<Tool> tools{finger("passing", 0.01, true),
                                flat_retractor("blade", {0.003, 0.012, 0.012}, true), pin("pin", 0.015)};
  Manipulation alone(organ.contact, tools), together(organ.contact, tools);
  for (int step = 0; step <= 12; ++step) {
    std::vector<OptionalPose> poses{std::nullopt, at_place(0.0325 - 0.0003 * step, 0.0004 * step, 0.06),
                                    std::nullopt};
    alone.step(poses);
    // Where it touches nothing, and at times.
    if (step % 3 != 0) poses[0] = at_place(0, 0.06, 0.05);
    if (step == 5) {
      together.grasp(2, at_place(0, -kRadius_m, 0.03));
      together.release(2);
    }
    together.step(poses);
    ASSERT_EQ(together.result().contacts.size(), alone.result().contacts.size()) << step;
    EXPECT_LE(largest(together.displacement_m() - alone.displacement_m()),
              1e-9 * largest(alone.displacement_m()));
  }
  EXPECT_GT(alone.result().tools[1].tangential_n, 0);
  // Taken away, the tool leaves nothing behind.
  together.step(std::vector<OptionalPose>(3));
  EXPECT_TRUE(together.result().contacts.empty());
  EXPECT_EQ(together.displacement_m(), organ.body.solve(organ.weight_n).displacement_m);
}

TEST(Manipulation, TheWholeSurfaceMayBeHeld) {
  const Organ organ;
  Manipulation manipulation(organ.contact,
                            {forceps("vice", {1, 1, 1}), pin("pin", 0.01), finger("finger", 0.01)});
  EXPECT_EQ(manipulation.grasp(0, at_place(0, 0, 0)), organ.contact.surface().size());
  const std::vector<OptionalPose> poses{turned(at_place(0.002, 0, 0.001), 0.3, {0, 0, 1}), std::nullopt,
                                        at_place(0.035, 0, 0.06)};
  const Eigen::VectorXd at_grasp_m = manipulation.displacement_m();
  manipulation.step(poses);
  EXPECT_TRUE(manipulation.result().contacts.empty());  // solids pass through what is bound
  Prescribed prescribed(organ.mesh, held_below(organ.mesh));
  prescribed.carry(nodes_of(manipulation.result(), 0), at_grasp_m, at_place(0, 0, 0), *poses[0]);
  expect_as(prescribed.body().solve(organ.weight_n), manipulation, 1e-9);
  EXPECT_THAT(message_of([&] { manipulation.grasp(1, at_place(kRadius_m, 0, 0.05)); }),
              AllOf(HasSubstr("held by other tools"), HasSubstr("whole surface")));
}

TEST(Manipulation, ANodeHasOneHolder) {
  const Organ organ;
  Manipulation manipulation(organ.contact, {forceps("first", kJaws_m), forceps("second", kJaws_m)});
  manipulation.grasp(0, at_place(kRadius_m, 0, 0.08));
  manipulation.grasp(1, at_place(kRadius_m, 0, 0.095));
  manipulation.step(std::vector<OptionalPose>{at_place(0.031, 0, 0.08), at_place(0.031, 0, 0.095)});
  const std::vector<std::uint32_t> first = nodes_of(manipulation.result(), 0),
                                   second = nodes_of(manipulation.result(), 1);
  EXPECT_FALSE(first.empty());
  EXPECT_FALSE(second.empty());
  for (const std::uint32_t node : first) EXPECT_EQ(std::ranges::count(second, node), 0);
}

/// A short manipulation with everything in it; where all nodes are, step by step.
std::vector<Eigen::VectorXd> manipulated(const ContactBody& body) {
  Manipulation manipulation(body,
                            {forceps("forceps", kJaws_m), pin("pin", 0.015), finger("finger", 0.01, true),
                             flat_retractor("blade", {0.003, 0.015, 0.015})});
  std::vector<OptionalPose> poses(4);
  std::vector<Eigen::VectorXd> found;
  for (int step = 0; step < 14; ++step) {
    if (step == 1) manipulation.grasp(0, at_place(kRadius_m, 0, 0.09));
    if (step == 4) manipulation.grasp(1, at_place(0, -kRadius_m, 0.08));
    if (step == 10) manipulation.release(0);
    poses[0] = turned(at_place(kRadius_m + 0.0005 * step, 0.0003 * step, 0.09), 0.02 * step, {1, 0, 1});
    poses[1] = at_place(0.0004 * step, -kRadius_m, 0.08);
    poses[2] = step < 3 ? OptionalPose() : at_place(0.0002 * step, 0.0395 - 0.0003 * step, 0.06);
    poses[3] = at_place(-0.0335 + 0.0002 * step, 0, 0.05);
    manipulation.step(poses);
    EXPECT_TRUE(manipulation.result().converged);
    found.push_back(manipulation.displacement_m());
    Eigen::VectorXd forces(24);
    for (std::size_t tool = 0; tool < 4; ++tool) {
      const ToolForce& feels = manipulation.result().tools[tool];
      forces.segment<6>(static_cast<Eigen::Index>(6 * tool)) << feels.force_n, feels.torque_nm;
    }
    found.push_back(forces);
  }
  return found;
}

TEST(Manipulation, SameStepsSameBitsWhateverTheNumberOfThreads) {
  const Organ organ;
  const std::vector<Eigen::VectorXd> expected = manipulated(organ.contact);
  for (const unsigned threads : {1U, 2U, 3U, 8U}) {
    const ContactBody other(organ.body, organ.weight_n, {threads, std::size_t{1} << 30});
    EXPECT_EQ(manipulated(other), expected) << threads;
  }
}

TEST(Manipulation, ColumnsOnDemandGiveTheSame) {
  const Organ organ;
  const ContactBody small(organ.body, organ.weight_n, {2, std::size_t{200} << 10});
  ASSERT_FALSE(small.compliance().complete());
  const std::vector<Eigen::VectorXd> expected = manipulated(organ.contact), found = manipulated(small);
  ASSERT_EQ(found.size(), expected.size());
  double worst = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const double error = largest(found[i] - expected[i]), scale = largest(expected[i]);
    EXPECT_LE(error, 1e-9 * scale) << i;
    if (scale > 0) worst = std::max(worst, error / scale);
  }
  record_elastic("error", worst);
}

TEST(Manipulation, GoesOnWithABodyThatWasCut) {
  const Organ organ;
  Manipulation before(organ.contact, {forceps("forceps", kJaws_m), finger("finger", 0.01, true)});
  const Pose from = at_place(kRadius_m, 0, 0.09);
  before.grasp(0, from);
  const Eigen::VectorXd at_grasp_m = before.displacement_m();
  const std::vector<OptionalPose> poses{turned(at_place(0.036, 0.001, 0.092), 0.3, {0, 1, 0}),
                                        at_place(-0.033, 0, 0.06)};
  before.step(poses);
  // The same body: nothing changes.
  const Manipulation same(organ.contact, before);
  EXPECT_LE(largest(same.displacement_m() - before.displacement_m()),
            1e-9 * largest(before.displacement_m()));
  EXPECT_LE((same.result().wrist_force_n - before.result().wrist_force_n).norm(),
            1e-6 * before.result().wrist_force_n.norm());
  // Without a wedge of its tetrahedra, and so with other nodes on the surface; the nodes keep their numbers.
  TetMesh cut = organ.mesh;
  cut.tetrahedra.clear();
  cut.regions.clear();
  for (const Tetrahedron& corners : organ.mesh.tetrahedra) {
    Vector3 middle_m = Vector3::Zero();
    for (const std::uint32_t node : corners) middle_m += organ.mesh.nodes[node] / 4;
    if (middle_m.y() > 0.005 && std::abs(middle_m.z() - 0.05) < 0.008) continue;
    cut.tetrahedra.push_back(corners);
    cut.regions.push_back(0);
  }
  ASSERT_LT(cut.tetrahedra.size(), organ.mesh.tetrahedra.size());
  const ElasticBody cut_body(cut, tissue(), held_below(cut));
  const ContactBody cut_contact(cut_body, organ.weight_n);
  Manipulation after(cut_contact, before);
  EXPECT_EQ(after.held_by(0), before.held_by(0));
  EXPECT_FALSE(after.result().contacts.empty());
  const std::vector<OptionalPose> without_finger{poses[0], std::nullopt};
  after.step(without_finger);
  Prescribed prescribed(cut, held_below(cut));
  prescribed.carry(nodes_of(after.result(), 0), at_grasp_m, from, *poses[0]);
  expect_as(prescribed.body().solve(organ.weight_n), after, 1e-9);
  const TetMesh other_mesh = test::tet_grid({1, 1, 1}, {0.01, 0.01, 0.01});
  const ElasticBody other(other_mesh, tissue(), held_below(other_mesh));
  const ContactBody other_contact(other);
  EXPECT_THROW(Manipulation(other_contact, before), UsageError);
}

TEST(Manipulation, ErrorsSayWhatToDo) {
  const Organ organ;
  const std::vector<Tool> tools{forceps("forceps", kJaws_m), pin("pin", 0.005), finger("finger", 0.01)};
  Manipulation manipulation(organ.contact, tools);
  const std::vector<OptionalPose> none(3);
  EXPECT_THAT(message_of([&] { manipulation.grasp(0, at_place(0.08, 0, 0.1)); }),
              AllOf(HasSubstr("forceps finds nothing to grasp"), HasSubstr(" mm away")));
  EXPECT_THAT(message_of([&] { manipulation.grasp(1, at_place(kRadius_m, 0, 0)); }),
              HasSubstr("1 node there cannot move"));
  EXPECT_THAT(message_of([&] { manipulation.grasp(0, at_place(std::nan(""), 0, 0)); }),
              HasSubstr("the pose of forceps"));
  EXPECT_THROW(manipulation.grasp(3, at_place(kRadius_m, 0, 0.09)), UsageError);
  EXPECT_THROW(manipulation.grasp(2, at_place(kRadius_m, 0, 0.09)), UsageError);
  EXPECT_THROW(manipulation.release(3), UsageError);
  EXPECT_THROW((void)manipulation.held_by(3), UsageError);
  EXPECT_THAT(message_of([&] { manipulation.release(0); }), HasSubstr("forceps holds nothing"));
  manipulation.grasp(0, at_place(kRadius_m, 0, 0.09));
  EXPECT_THAT(message_of([&] { manipulation.grasp(0, at_place(kRadius_m, 0, 0.09)); }),
              AllOf(HasSubstr("forceps already holds"), HasSubstr("release it")));
  manipulation.step(std::vector<OptionalPose>{at_place(kRadius_m, 0, 0.09), std::nullopt, std::nullopt});
  const std::uint32_t taken = manipulation.result().bound.front().node;
  const Vector3 taken_m = organ.contact.rest_m().segment<3>(first_row(taken));
  EXPECT_THAT(message_of([&] { manipulation.grasp(1, at_place(taken_m.x(), taken_m.y(), taken_m.z())); }),
              HasSubstr("held by other tools"));
  EXPECT_THAT(message_of([&] { manipulation.step(none); }),
              AllOf(HasSubstr("forceps holds"), HasSubstr("no pose")));
  EXPECT_THROW(manipulation.step({}), UsageError);
  EXPECT_THROW(Manipulation(organ.contact, {tools[0], tools[0]}), UsageError);
  EXPECT_THROW(Manipulation(organ.contact, {forceps("", kJaws_m)}), UsageError);
  EXPECT_THROW(Manipulation(organ.contact, {pin("pin", 0)}), UsageError);
  EXPECT_THROW(Manipulation(organ.contact, tools, {0, 10}), UsageError);
}

TEST(Manipulation, WhatIsRefusedChangesNothing) {
  const Organ organ;
  Manipulation manipulation(organ.contact,
                            {forceps("forceps", kJaws_m), flat_retractor("upper", {0.1, 0.1, 0.01}, true),
                             flat_retractor("lower", {0.1, 0.1, 0.01})});
  manipulation.grasp(0, at_place(kRadius_m, 0, 0.06));
  const std::vector<OptionalPose> fine{at_place(0.033, 0, 0.061), at_place(0, 0, 0.109), at_place(0, 0, 0.2)};
  manipulation.step(fine);
  const Eigen::VectorXd before_m = manipulation.displacement_m();
  const Vector3 before_n = manipulation.result().wrist_force_n;
  const auto expect_refused = [&](const std::vector<OptionalPose>& poses, const char* why) {
    EXPECT_THAT(message_of([&] { manipulation.step(poses); }), HasSubstr(why));
    EXPECT_EQ(manipulation.displacement_m(), before_m);
    EXPECT_EQ(manipulation.result().wrist_force_n, before_n);
  };
  Pose unsound = at_place(0, 0, 0);
  unsound.orientation.coeffs().setZero();
  expect_refused({unsound, fine[1], fine[2]}, "the pose of forceps");
  expect_refused({at_place(1e308, 1e308, 0), fine[1], fine[2]}, "out of all proportion");
  expect_refused({at_place(1e200, 0, 0), std::nullopt, std::nullopt}, "out of all proportion");
  expect_refused({fine[0], at_place(0, 0, std::numeric_limits<double>::infinity()), fine[2]},
                 "the pose of upper");
  expect_refused({fine[0], fine[1], at_place(0, 0, 0.0905)}, "no place");
  EXPECT_THROW(manipulation.grasp(0, at_place(kRadius_m, 0, 0.06)), Error);
  manipulation.step(fine);
  EXPECT_LE(largest(manipulation.displacement_m() - before_m), 1e-9 * largest(before_m));
}

TEST(Manipulation, NodesThatNearlyNothingMovesAreNotGrasped) {
  // A part of steel and more in soft tissue: its compliance is lost in rounding.
  TetMesh mesh = test::tet_grid({2, 2, 4}, {0.02, 0.02, 0.04});
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    double z_m = 0;
    for (const std::uint32_t node : mesh.tetrahedra[t]) z_m += mesh.nodes[node].z() / 4;
    mesh.regions[t] = z_m > 0.02 ? 1 : 0;
  }
  const ElasticBody body(mesh, {{0, {1e3, 0.3}}, {1, {1e13, 0.3}}}, held_below(mesh));
  const ContactBody contact(body);
  Manipulation manipulation(contact, {forceps("forceps", {0.03, 0.03, 0.011})});
  const Eigen::VectorXd before_m = manipulation.displacement_m();
  EXPECT_THAT(message_of([&] { manipulation.grasp(0, at_place(0.01, 0.01, 0.04)); }),
              HasSubstr("badly conditioned"));
  EXPECT_EQ(manipulation.held_by(0), 0U);
  manipulation.step(std::vector<OptionalPose>(1));
  EXPECT_EQ(manipulation.displacement_m(), before_m);
}

}  // namespace
}  // namespace kiroku::sim
