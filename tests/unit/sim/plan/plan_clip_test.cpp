// A clip closes on a block, is left there, holds what is between its jaws, and goes where the block does.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "sim/mesh/degrees_of_freedom.h"
#include "sim/mesh/mesh_writer.h"
#include "sim/plan/plan_document.h"
#include "sim/plan/plan_report.h"
#include "tests/support/calculix.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A block of 40 x 20 x 20 mm held at x = 0. A clip of 8 mm length closes along z around x = 25 mm; forceps
/// have the free end.
class PlanClipTest : public testing::Test {
 protected:
  PlanClipTest() {
    std::ofstream(folder_ / "block.msh")
        << msh_text(test::tet_grid({10, 5, 5}, {0.04, 0.02, 0.02}), LengthUnit::kMillimetre);
    document_ = ordered_json::parse(R"({
      "name": "Clip", "mesh": "block.msh", "length_unit": "mm", "time_step_s": 0.1,
      "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.3}],
      "fixed": [{"box": [[0, 0, 0], [0, 20, 20]]}],
      "tools": {"clip": {"kind": "clip", "jaw": [9, 30, 4], "opening": 22, "friction": 0.5},
                "forceps": {"kind": "forceps", "jaws": [2, 30, 30]}},
      "steps": [{"do": "close", "tool": "clip", "at": {"position": [24, 10, 10]}, "opening": 14, "duration_s": 0.4},
                {"do": "release", "tool": "clip"},
                {"do": "grasp", "tool": "forceps", "at": {"position": [40, 10, 10]}}]})");
  }
  void pull(double x_mm, double y_mm, double z_mm) {
    document_["steps"].push_back({{"do", "retract"},
                                  {"tool", "forceps"},
                                  {"path", {{{"at_s", 0.5}, {"position", {x_mm, y_mm, z_mm}}}}}});
  }
  [[nodiscard]] std::vector<std::string> errors() const {
    std::vector<std::string> errors = read_plan_text(document_.dump(), folder_ / "plan.json").errors;
    const std::string before = "cannot use " + (folder_ / "plan.json").string() + ": ";
    for (std::string& error : errors) {
      if (error.starts_with(before)) error.erase(0, before.size());
    }
    return errors;
  }
  [[nodiscard]] Plan plan() const {
    PlanReading reading = read_plan_text(document_.dump(), folder_ / "plan.json");
    EXPECT_THAT(reading.errors, IsEmpty());
    return *reading.plan;
  }
  static std::string failure(const Plan& plan) {
    try {
      PlanRun run(plan);
      while (run.next()) {
      }
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  static std::size_t number_of(const Plan& plan, const char* name) {
    return static_cast<std::size_t>(
        std::ranges::find(plan.tools, name, [](const PlanTool& one) { return one.tool.name; }) -
        plan.tools.begin());
  }

  test::TemporaryFolder folder_;
  ordered_json document_;
};

/// What a clip that was left holds: nodes and where they are.
std::map<std::uint32_t, Vector3> held_by_clip(const PlanRun& run, std::size_t forceps) {
  std::map<std::uint32_t, Vector3> held;
  const PlanFrame& frame = run.frame();
  for (std::uint32_t node = 0; node < run.mesh().nodes.size(); ++node) {
    if (frame.tool_force_n.segment<3>(first_row(node)).isZero(0)) continue;
    const Vector3 place_m = run.mesh().nodes[node] + frame.displacement_m.segment<3>(first_row(node));
    if (frame.poses[forceps] && run.mesh().nodes[node].x() > 0.03) continue;
    held[node] = place_m;
  }
  return held;
}

TEST_F(PlanClipTest, StaysWhenItsApplierLeavesAndHoldsAsABodyInBalanceThatMovesAsOne) {
  pull(42, 13, 12);
  const Plan read = plan();
  const std::size_t clip = number_of(read, "clip"), forceps = number_of(read, "forceps");
  PlanRun run(read);
  std::map<std::uint32_t, Vector3> left_m;
  Pose left;
  double closed_n = 0;
  while (run.next()) {
    const PlanFrame& frame = run.frame();
    if (frame.step == 0) {
      closed_n = frame.grips[clip].grip.squeeze_n;
      left_m = held_by_clip(run, forceps);
      if (frame.poses[clip]) left = *frame.poses[clip];
    }
    if (frame.step == 0) continue;
    ASSERT_TRUE(frame.poses[clip]);
    EXPECT_TRUE(frame.grips[clip].left);
    EXPECT_EQ(frame.grips[clip].opening_m, 0.014);
    // Nobody holds it: what the tissue does to it is in balance.
    EXPECT_LT(frame.tools[clip].force_n.norm(), 1e-9 * closed_n);
    // Rotations are small ones, so that torques balance about where it was left.
    Vector3 torque_nm = Vector3::Zero();
    for (const auto& [node, place_m] : left_m)
      torque_nm += (place_m - left.position_m).cross(frame.tool_force_n.segment<3>(first_row(node)));
    EXPECT_LT(torque_nm.norm(), 1e-9 * closed_n * 0.02);
    // The jaws still press, about as they did.
    EXPECT_NEAR(frame.grips[clip].grip.squeeze_n, closed_n, 0.3 * closed_n);
  }
  // On this coarse mesh tissue also lies at the jaws' sides: that is not between them, and is not held.
  const std::size_t pressed = left_m.size();
  std::erase_if(left_m, [&](const auto& one) {
    return std::abs(std::abs(left.to_tool(one.second).z()) - 0.007) > 1e-6;
  });
  EXPECT_GE(left_m.size(), 12U);
  EXPECT_LT(left_m.size(), pressed);
  // What is held moves as one rigid body (of small rotations), and the jaws with it.
  const std::map<std::uint32_t, Vector3> now_m = held_by_clip(run, forceps);
  ASSERT_EQ(now_m.size(), left_m.size());
  const Pose now = *run.frame().poses[clip];
  const Eigen::AngleAxisd turn(now.orientation * left.orientation.conjugate());
  const Vector3 turned = turn.angle() * turn.axis();
  EXPECT_GT((now.position_m - left.position_m).norm(), 1e-3);
  EXPECT_GT(turned.norm(), 0.01);
  double moved_m = 0;
  for (const auto& [node, place_m] : left_m) {
    const Vector3 arm_m = place_m - left.position_m;
    const Vector3 expected_m = now.position_m + arm_m + turned.cross(arm_m);
    EXPECT_LT((now_m.at(node) - expected_m).norm(), 1e-9);
    moved_m = std::max(moved_m, (now_m.at(node) - place_m).norm());
  }
  EXPECT_GT(moved_m, 1e-3);
  // The forces of clip and forceps bring the body about: they alone give these displacements.
  const ElasticBody body(read.body.mesh, read.body.materials, read.body.constraints);
  const Eigen::VectorXd solved_m = body.solve(run.frame().tool_force_n).displacement_m;
  EXPECT_LT((solved_m - run.frame().displacement_m).lpNorm<Eigen::Infinity>(), 1e-9 * 0.02);
  for (const StepFigures& figures : run.figures()) EXPECT_THAT(figures.remarks, IsEmpty());
  const json steps = json::parse(steps_json(read, run, {}))["steps"];
  EXPECT_GT(steps[1]["tools"]["clip"]["largest_squeeze_n"].get<double>(), 0.5 * closed_n);
  EXPECT_EQ(steps[1]["tools"]["clip"]["most_nodes"], left_m.size());
}

/// CalculiX, with what the clip holds tied by *RIGID BODY. It turns nodes about where they are at rest, ours
/// about where the jaws have brought them: these close by a two thousandth here, and no more can differ.
TEST_F(PlanClipTest, MovesAsARigidBodyOfCalculix) {
  if (!test::has_ccx()) GTEST_SKIP() << "ccx (CalculiX) is not installed";
  document_["tools"]["clip"]["friction"] = 10;
  document_["steps"][0]["opening"] = 19.99;
  pull(40.02, 10.02, 10.01);
  const Plan read = plan();
  const std::size_t forceps = number_of(read, "forceps");
  PlanRun run(read);
  std::map<std::uint32_t, Vector3> left_m;
  Eigen::VectorXd before_m;
  while (run.next()) {
    if (run.frame().step != 1) continue;
    left_m = held_by_clip(run, forceps);
    before_m = run.frame().displacement_m;
  }
  ASSERT_GE(left_m.size(), 20U);
  ASSERT_TRUE(run.frame().poses[number_of(read, "clip")]);
  const Eigen::VectorXd ours_m = run.frame().displacement_m - before_m;

  test::CalculixCase theirs{read.body.mesh, read.body.materials, read.body.constraints,
                            run.frame().tool_force_n};
  for (const auto& [node, place_m] : left_m) theirs.force_n.segment<3>(first_row(node)).setZero();
  theirs.rigid.assign(1, {});
  for (const auto& [node, place_m] : left_m) theirs.rigid.front().push_back(node);
  const test::CalculixResult tied = test::run_calculix(theirs, theirs.force_n);
  double largest_m = 0, difference_m = 0, untied_m = 0;
  theirs.rigid.clear();
  const test::CalculixResult untied = test::run_calculix(theirs, theirs.force_n);
  for (std::size_t node = 0; node < read.body.mesh.nodes.size(); ++node) {
    const Vector3 theirs_m = tied.displacement_m.segment<3>(first_row(node));
    largest_m = std::max(largest_m, theirs_m.norm());
    difference_m = std::max(difference_m, (ours_m.segment<3>(first_row(node)) - theirs_m).norm());
    untied_m = std::max(untied_m, (untied.displacement_m.segment<3>(first_row(node)) - theirs_m).norm());
  }
  EXPECT_GT(largest_m, 1e-5);
  EXPECT_LE(difference_m, 1e-3 * largest_m);
  EXPECT_GT(untied_m, 0.05 * largest_m) << "the tie shows";
  char text[32];
  std::snprintf(text, sizeof text, "%.1e", difference_m / largest_m);
  RecordProperty("clip_calculix_difference", text);
}

TEST_F(PlanClipTest, WhileItsApplierHasItItIsAGrasperToTheBit) {
  document_["steps"] = ordered_json::array(
      {document_["steps"][0],
       {{"do", "retract"}, {"tool", "clip"}, {"path", {{{"at_s", 4}, {"position", {50, 10, 10}}}}}}});
  const auto end = [&](const char* kind) {
    document_["tools"]["clip"]["kind"] = kind;
    const Plan read = plan();
    PlanRun run(read);
    while (run.next()) {
    }
    EXPECT_THAT(run.figures()[1].remarks, testing::Contains(HasSubstr("the tissue slips in 'clip', by ")));
    return run.frame().displacement_m;
  };
  EXPECT_EQ((end("clip") - end("grasper")).lpNorm<Eigen::Infinity>(), 0);
}

/// One side of the block is pulled, the other is not: the jaws are pulled against each other.
TEST_F(PlanClipTest, ComesOffWhereFrictionCannotHoldWhatPullsAlongItsJaws) {
  document_["tools"]["forceps"]["jaws"] = {4, 30, 6};
  document_["steps"][2]["at"]["position"] = {40, 10, 20};
  pull(60, 10, 20);
  const ordered_json sound = document_;
  /// Step by step what was told; expects that whoever holds is within friction, and that what came off holds
  /// nothing.
  const auto remarks = [&](double friction, double to_x_mm) {
    document_ = sound;
    document_["tools"]["clip"]["friction"] = friction;
    document_["steps"][3]["path"][0]["position"][0] = to_x_mm;
    const Plan read = plan();
    const std::size_t clip = number_of(read, "clip");
    PlanRun run(read);
    std::vector<std::string> told;
    while (run.next()) {
      const PlanGrip& grip = run.frame().grips[clip];
      if (!grip.left) continue;
      EXPECT_LT(grip.grip.pull_n, grip.grip.most_pull_n);
    }
    for (const StepFigures& figures : run.figures())
      told.push_back(figures.remarks.empty() ? "" : figures.remarks.front());
    const bool on = run.frame().grips[clip].left;
    EXPECT_EQ(run.frame().poses[clip].has_value(), on);
    EXPECT_EQ(run.frame().tools[clip].nodes > 0, on);
    EXPECT_EQ(!held_by_clip(run, number_of(read, "forceps")).empty(), on);
    return told;
  };
  const auto comes_off =
      AllOf(HasSubstr("'clip' comes off and lets the tissue go: "), HasSubstr(" N each and hold "));
  EXPECT_THAT(remarks(0.3, 60), ElementsAre("", "", "", ""));
  EXPECT_THAT(remarks(0.3, 140), ElementsAre("", "", "", comes_off)) << "pulled too hard";
  EXPECT_THAT(remarks(0.02, 60), ElementsAre("", comes_off, "", ""))
      << "as slippery as this it holds nowhere";
}

TEST_F(PlanClipTest, SaysWhatCannotBe) {
  const ordered_json sound = document_;
  document_["steps"].push_back({{"do", "close"}, {"tool", "clip"}, {"opening", 12}, {"duration_s", 1}});
  EXPECT_THAT(errors(),
              ElementsAre("steps[3].tool is 'clip', a clip that was left at the organ in steps[1]: a "
                          "clip is used once; give the plan another"));
  document_ = sound;
  document_["steps"].push_back({{"do", "release"}, {"tool", "clip"}});
  EXPECT_THAT(errors(), ElementsAre(HasSubstr("a clip is used once")));
  document_ = sound;
  document_["corotational"] = true;
  EXPECT_THAT(errors(),
              testing::Contains(HasSubstr("tools.clip.kind is 'clip': a clip that was left holds tissue "
                                          "of linear elements alone; leave out 'corotational'")));
  // Opened again, it holds nothing that it could be left on.
  document_ = sound;
  const ordered_json opens = {{"do", "close"}, {"tool", "clip"}, {"opening", 22}, {"duration_s", 0.4}};
  document_["steps"].insert(document_["steps"].begin() + 1, opens);
  EXPECT_THAT(failure(plan()),
              "steps[2] (release): 'clip' would be left with nothing between its jaws: close it "
              "further, or place it elsewhere");
}

TEST_F(PlanClipTest, IsNotLeftOnTissueThatIsFixedAlongAnAxis) {
  document_["fixed"].push_back({{"box", {{16, 0, 0}, {32, 20, 0}}}, {"displacement", {nullptr, 0, nullptr}}});
  EXPECT_THAT(failure(plan()), HasSubstr("presses tissue that is fixed along an axis"));
}

TEST_F(PlanClipTest, StaysOnABodyThatIsCutAndIsUndoneByHand) {
  document_["tools"]["scalpel"] = {{"kind", "scalpel"}, {"edge", 60}};
  document_["steps"].push_back(
      {{"do", "cut"},
       {"tool", "scalpel"},
       {"path",
        {{{"at_s", 0}, {"position", {34, -10, -10}}}, {{"at_s", 0.3}, {"position", {34, 12, -10}}}}}});
  const Plan cutting = plan();
  PlanRun cut(cutting);
  while (cut.next()) {
  }
  EXPECT_GT(cut.figures().back().tetrahedra_removed, 0U);
  EXPECT_TRUE(cut.frame().grips[number_of(cutting, "clip")].left);
  EXPECT_GT(cut.frame().grips[number_of(cutting, "clip")].grip.squeeze_n, 0.01);

  // By hand, and saved: run anew, the plan ends in the same bits.
  document_["tools"].erase("scalpel");
  document_["steps"] = ordered_json::array({{{"do", "hold"}, {"duration_s", 0.1}}});
  const Plan own = plan();
  const ordered_json tooled = with_tools(document_, own);
  EXPECT_EQ(tooled["tools"]["clip 4"]["kind"], "clip");
  ordered_json turning = document_;
  turning["tools"].erase("clip");
  turning["corotational"] = true;
  const Plan turns = *read_plan_text(turning.dump(), folder_ / "plan.json").plan;
  EXPECT_FALSE(with_tools(turning, turns)["tools"].contains("clip 1"));
  PlanSession session(*read_plan_text(tooled.dump(), folder_ / "plan.json").plan);
  const std::size_t number = number_of(session.plan(), "clip");
  Pose pose;
  pose.position_m = {0.024, 0.01, 0.01};
  session.close({number, pose}, 0.014);
  session.release(number);
  EXPECT_TRUE(session.used_up(number));
  EXPECT_TRUE(session.frame().grips[number].left);
  EXPECT_THROW(session.release(number), Error);
  EXPECT_THROW(session.close({number, {}}, 0.012), Error);
  EXPECT_THROW(session.begin_motion({{number, {}}}), Error);
  session.hold(0.2);
  const ordered_json saved = document_of(document_, tooled, session, "By hand");
  const Plan again = *read_plan_text(saved.dump(), folder_ / "plan.json").plan;
  PlanRun run(again);
  while (run.next()) {
  }
  EXPECT_EQ((run.frame().displacement_m - session.frame().displacement_m).lpNorm<Eigen::Infinity>(), 0);
  session.undo();
  session.undo();
  EXPECT_FALSE(session.used_up(number));
  EXPECT_FALSE(session.frame().grips[number].left);
  session.close({number, {}}, 0.012);
  EXPECT_NEAR(session.frame().grips[number].opening_m, 0.012, 1e-12);
}

}  // namespace
}  // namespace kiroku::sim
