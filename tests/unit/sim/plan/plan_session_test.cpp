#include "sim/plan/plan_session.h"

#include <cmath>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "sim/mesh/mesh_writer.h"
#include "sim/plan/plan_document.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using nlohmann::ordered_json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

/// A block of 40 x 20 x 20 mm held at x = 0, nodes every 5 mm.
class PlanSessionTest : public testing::Test {
 protected:
  PlanSessionTest() {
    std::ofstream(folder_ / "block.msh")
        << msh_text(test::tet_grid({8, 4, 4}, {0.04, 0.02, 0.02}), LengthUnit::kMillimetre);
    own_ = ordered_json::parse(R"({
      "name": "Block", "mesh": "block.msh", "length_unit": "mm", "time_step_s": 0.1,
      "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.4}],
      "fixed": [{"box": [[0, 0, 0], [0, 20, 20]]}],
      "tools": {"clamp": {"kind": "forceps", "jaws": [2, 30, 30]}},
      "steps": [{"do": "grasp", "name": "Clamp it", "tool": "clamp", "at": {"position": [40, 10, 10]}},
                {"do": "retract", "tool": "clamp", "path": [{"at_s": 0.35, "position": [42.123456789, 10, 10]}]}]})");
    tooled_ = with_tools(own_, read(own_));
  }
  [[nodiscard]] Plan read(const ordered_json& document) const {
    PlanReading reading = read_plan_text(document.dump(), folder_ / "plan.json");
    EXPECT_THAT(reading.errors, IsEmpty());
    return *reading.plan;
  }
  [[nodiscard]] std::size_t tool(const PlanSession& session, const std::string& name) const {
    const std::vector<PlanTool>& tools = session.plan().tools;
    const auto found = std::ranges::find(tools, name, [](const PlanTool& one) { return one.tool.name; });
    EXPECT_NE(found, tools.end()) << name;
    return static_cast<std::size_t>(found - tools.begin());
  }
  static Pose at(double x_mm, double y_mm, double z_mm) {
    Pose pose;
    pose.position_m = Vector3(x_mm, y_mm, z_mm) / 1000;
    return pose;
  }
  /// Its edge runs down along y.
  static Pose knife_at(double x_mm, double z_mm) {
    Pose pose = at(x_mm, 30, z_mm);
    pose.orientation = Eigen::AngleAxisd(1.5707, Vector3::UnitX());
    return pose;
  }
  /// The plan of the saved document, run from its beginning, ends where the session is.
  void expect_saved_plan_ends_here(const PlanSession& session) const {
    const ordered_json saved = document_of(own_, tooled_, session, "By hand");
    const Plan plan = read(saved);
    ASSERT_EQ(plan.steps.size(), session.plan().steps.size()) << saved.dump(1);
    PlanRun run(plan);
    while (run.next()) {
    }
    const PlanFrame &ran = run.frame(), &made = session.frame();
    EXPECT_EQ(run.mesh().tetrahedra, session.mesh().tetrahedra);
    EXPECT_EQ(run.mesh().nodes, session.mesh().nodes);
    ASSERT_EQ(ran.displacement_m.size(), made.displacement_m.size());
    EXPECT_EQ((ran.displacement_m - made.displacement_m).lpNorm<Eigen::Infinity>(), 0);
    EXPECT_EQ((ran.tool_force_n - made.tool_force_n).lpNorm<Eigen::Infinity>(), 0);
    EXPECT_DOUBLE_EQ(ran.time_s, made.time_s);
  }

  test::TemporaryFolder folder_;
  ordered_json own_, tooled_;
};

TEST_F(PlanSessionTest, WhatIsSavedRunsToTheSameBits) {
  PlanSession session(read(tooled_));
  EXPECT_EQ(session.given_steps(), 2U);
  const std::size_t clamp = tool(session, "clamp");
  session.begin_motion({{clamp, {}}});
  for (int i = 1; i <= 7; ++i) session.advance(std::vector{at(42.1 + 0.3 * i, 10, 10 - 0.1234567891 * i)});
  session.hold(0.25);
  const std::size_t one = tool(session, "finger 1"), two = tool(session, "finger 2");
  session.begin_motion({{two, at(22, 10, -8.5)}, {one, at(22, 10, 28.5)}});
  for (int i = 1; i <= 4; ++i) session.advance(std::vector{at(22, 10, 28.5 - i), at(22, 10, -8.5 + i)});
  EXPECT_THAT(session.end_motion(), IsEmpty());
  EXPECT_GT(session.frame().tools[one].force_n.norm(), 0.01);
  session.cut(tool(session, "scalpel"),
              std::vector{knife_at(32.3, 30), knife_at(32.3, 15), knife_at(32.1, 9.7)});
  EXPECT_LT(session.mesh().tetrahedra.size(), session.plan().body.mesh.tetrahedra.size());
  session.release(one);
  expect_saved_plan_ends_here(session);
}

TEST_F(PlanSessionTest, SavesOnlyToolsThatAreUsedAndStepsAsTheyWereGiven) {
  PlanSession session(read(tooled_));
  session.hold(0.2);
  const ordered_json saved = document_of(own_, tooled_, session, "By hand");
  EXPECT_EQ(saved["name"], "By hand");
  EXPECT_EQ(saved["tools"], own_["tools"]);
  EXPECT_EQ(saved["steps"][1], own_["steps"][1]);
  EXPECT_EQ(saved["steps"][2], ordered_json::parse(R"({"do": "hold", "duration_s": 0.2})"));
}

TEST_F(PlanSessionTest, UndoneIsAsBeforeAndRedoneAsItWas) {
  PlanSession session(read(tooled_));
  const Eigen::VectorXd given = session.frame().displacement_m;
  const std::size_t finger = tool(session, "finger 3");
  session.begin_motion({{finger, at(20, 10, 28)}});
  for (int i = 1; i <= 5; ++i) session.advance(std::vector{at(20, 10, 28 - i)});
  session.end_motion();
  const Eigen::VectorXd pressed = session.frame().displacement_m;
  session.cut(tool(session, "scalpel"), std::vector{knife_at(32.3, 30), knife_at(32.3, 12)});
  const Eigen::VectorXd was_cut = session.frame().displacement_m;
  const std::size_t left = session.mesh().tetrahedra.size();
  ASSERT_TRUE(session.undo());
  EXPECT_EQ(session.frame().displacement_m, pressed);
  EXPECT_EQ(session.mesh().tetrahedra.size(), session.plan().body.mesh.tetrahedra.size());
  ASSERT_TRUE(session.undo());
  EXPECT_EQ(session.frame().displacement_m, given);
  EXPECT_FALSE(session.frame().poses[finger].has_value());
  ASSERT_TRUE(session.redo());
  EXPECT_EQ(session.frame().displacement_m, pressed);
  ASSERT_TRUE(session.redo());
  EXPECT_EQ(session.frame().displacement_m, was_cut);
  EXPECT_EQ(session.mesh().tetrahedra.size(), left);
  EXPECT_FALSE(session.redo());
  expect_saved_plan_ends_here(session);
  while (session.undo()) {
  }
  EXPECT_THAT(session.plan().steps, IsEmpty());
  EXPECT_LT(session.frame().displacement_m.norm(), 1e-12);
  session.hold(0.1);
  EXPECT_FALSE(session.can_redo());
}

TEST_F(PlanSessionTest, GoesBackFurtherThanItRemembers) {
  PlanSession session(read(tooled_));
  const Eigen::VectorXd given = session.frame().displacement_m;
  for (int i = 0; i < 40; ++i) session.hold(0.1);
  for (int i = 0; i < 40; ++i) ASSERT_TRUE(session.undo());
  EXPECT_EQ(session.frame().displacement_m, given);
  EXPECT_EQ(session.plan().steps.size(), 2U);
}

TEST_F(PlanSessionTest, ACutThatWasDrawnIsChangedAfterwardsAsIfItHadBeenDrawnSo) {
  CutCurve curve{{Vector3(0.0223, 0, 0.02), Vector3(0.0225, 0.02, 0.02)}, true, {0.006}, {}};
  PlanSession session(read(tooled_));
  const std::size_t scalpel = tool(session, "scalpel");
  session.cut(scalpel, curve);
  const Eigen::VectorXd shallow = session.frame().displacement_m;
  const std::vector<Vector3> shallow_nodes = session.mesh().nodes;
  expect_saved_plan_ends_here(session);
  session.hold(0.2);
  // Deeper and farther on, though a step has come since: nothing is left of the first cut.
  CutCurve deeper = curve;
  deeper.depth_m = {0.013};
  deeper.handles_m[1].x() = 0.0275;
  session.change_cut(2, deeper);
  ASSERT_THAT(session.plan().steps, SizeIs(4));
  expect_saved_plan_ends_here(session);
  PlanSession at_once(read(tooled_));
  at_once.cut(scalpel, deeper);
  at_once.hold(0.2);
  EXPECT_EQ(session.frame().displacement_m, at_once.frame().displacement_m);
  EXPECT_EQ(session.mesh().tetrahedra, at_once.mesh().tetrahedra);
  EXPECT_NE(session.mesh().nodes, shallow_nodes);
  // Undone as a whole, done again, and undone with what came before it.
  const std::optional<std::size_t> the_cut = 2;
  EXPECT_EQ(session.undo(), the_cut) << "the step that was carried out again first";
  EXPECT_EQ(session.mesh().nodes, shallow_nodes);
  EXPECT_EQ(session.frame().displacement_m, shallow);
  ASSERT_THAT(session.plan().steps, SizeIs(4));
  EXPECT_EQ(session.redo(), the_cut);
  EXPECT_EQ(session.frame().displacement_m, at_once.frame().displacement_m);
  EXPECT_TRUE(session.undo());
  EXPECT_TRUE(session.undo());
  EXPECT_TRUE(session.undo());
  ASSERT_THAT(session.plan().steps, SizeIs(2));
  EXPECT_TRUE(session.redo());
  EXPECT_EQ(session.mesh().nodes, shallow_nodes);
  EXPECT_TRUE(session.redo());
  EXPECT_TRUE(session.redo());
  EXPECT_EQ(session.frame().displacement_m, at_once.frame().displacement_m);
  EXPECT_FALSE(session.redo());
}

TEST_F(PlanSessionTest, AChangeThatCannotBeLeavesTheCutAsItWas) {
  const CutCurve curve{{Vector3(0.0223, 0, 0.02), Vector3(0.0225, 0.02, 0.02)}, true, {0.006}, {}};
  PlanSession session(read(tooled_));
  session.cut(tool(session, "scalpel"), curve);
  session.grasp({tool(session, "forceps 1"), at(34, 10, 20)});
  const Eigen::VectorXd before = session.frame().displacement_m;
  CutCurve outside = curve;
  outside.handles_m[0].z() = 0.08;
  EXPECT_THROW(session.change_cut(2, outside), Error);
  EXPECT_THROW(session.change_cut(1, curve), Error) << "a retraction has no handles";
  EXPECT_THROW(session.change_cut(7, curve), Error);
  // The cut can be made right through, but what is grasped afterwards has fallen off then.
  CutCurve through = curve;
  through.depth_m = {0.03};
  through.direction = Vector3(0, 0, -1);
  try {
    session.change_cut(2, through);
    ADD_FAILURE() << "not refused";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("steps[3] (grasp): "));
  }
  EXPECT_EQ(session.frame().displacement_m, before);
  ASSERT_THAT(session.plan().steps, SizeIs(4));
  expect_saved_plan_ends_here(session);
}

TEST_F(PlanSessionTest, FingersThatNeverTouchAreLeftOut) {
  PlanSession session(read(tooled_));
  const std::size_t one = tool(session, "finger 1"), two = tool(session, "finger 2");
  session.begin_motion({{one, at(22, 10, 28.5)}, {two, at(22, 10, 60)}});
  for (int i = 1; i <= 4; ++i) session.advance(std::vector{at(22, 10, 28.5 - i), at(22, 10, 60 - i)});
  EXPECT_THAT(session.end_motion(), ElementsAre("finger 2"));
  ASSERT_THAT(session.plan().steps, SizeIs(3));
  EXPECT_THAT(session.plan().steps.back().motions, SizeIs(1));
  EXPECT_TRUE(session.frame().poses[one].has_value());
  EXPECT_FALSE(session.frame().poses[two].has_value());
  // One that slid off is taken away.
  session.begin_motion({{one, {}}});
  for (int i = 1; i <= 3; ++i) session.advance(std::vector{at(22, 10, 50 + i)});
  EXPECT_THAT(session.end_motion(), ElementsAre("finger 1"));
  EXPECT_FALSE(session.frame().poses[one].has_value());
  EXPECT_EQ(session.plan().steps.back().action, PlanAction::kRelease);
  expect_saved_plan_ends_here(session);
  // Nothing has moved: no step.
  session.begin_motion({{two, at(22, 10, 60)}});
  EXPECT_THAT(session.end_motion(), IsEmpty());
  EXPECT_THAT(session.plan().steps, SizeIs(4));
}

TEST_F(PlanSessionTest, WhatCannotBeLeavesItAsItWas) {
  PlanSession session(read(tooled_));
  const Eigen::VectorXd given = session.frame().displacement_m;
  const auto refusal = [&](auto&& deed) -> std::string {
    try {
      deed();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal([&] {
                session.grasp({tool(session, "forceps 1"), at(80, 80, 80)});
              }),
              HasSubstr("steps[2] (grasp): "));
  EXPECT_THAT(refusal([&] {
                session.cut(tool(session, "scalpel"), std::vector{knife_at(80, 30), knife_at(80, 0)});
              }),
              HasSubstr("never meets the tissue"));
  EXPECT_THAT(refusal([&] { session.release(tool(session, "finger 1")); }), HasSubstr("not at the organ"));
  EXPECT_THAT(refusal([&] {
                session.grasp({tool(session, "clamp"), at(40, 10, 10)});
              }),
              HasSubstr("release it"));
  EXPECT_THAT(refusal([&] {
                session.grasp({tool(session, "finger 1"), at(40, 10, 10)});
              }),
              HasSubstr("only forceps"));
  EXPECT_EQ(session.plan().steps.size(), 2U);
  EXPECT_EQ(session.frame().displacement_m, given);
  // What came before stays.
  session.begin_motion({{tool(session, "finger 1"), at(22, 10, 28.5)}});
  for (int i = 1; i <= 4; ++i) session.advance(std::vector{at(22, 10, 28.5 - i)});
  EXPECT_THAT(refusal([&] { session.advance(std::vector{at(std::nan(""), 10, 24)}); }),
              HasSubstr("steps[2] (press): the pose of finger 1 is none"));
  EXPECT_EQ(session.plan().steps.size(), 3U);
  EXPECT_EQ(session.plan().steps.back().duration_s, 0.4);
  EXPECT_FALSE(session.moving());
  expect_saved_plan_ends_here(session);
}

}  // namespace
}  // namespace kiroku::sim
