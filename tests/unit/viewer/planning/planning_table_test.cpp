// Planning without a network on a block that a CT shows: pointers, lines and saving, against the plan that is
// run.
#include "viewer/planning/planning_table.h"

#include <algorithm>
#include <atomic>
#include <fstream>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sim/mesh/mesh_writer.h"
#include "sim/plan/plan_run.h"
#include "tests/support/eventually.h"
#include "tests/support/moved_clock.h"
#include "tests/unit/viewer/planning/planned_block.h"
#include "viewer/http/request.h"
#include "viewer/planning/live_planning.h"
#include "viewer/planning/planning_messages.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

const TableOptions kSmall{"liver", sim::GpuUse::kOff, 96, 72};

class PlanningTableTest : public testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<PlanningTable> table(bool anew = true) const {
    OpenedPlan opened = plans_.open("block/plan.json", [](const std::string& /*step*/) {});
    return std::make_unique<PlanningTable>(std::move(opened), anew, kSmall, [](double /*time_s*/) {});
  }
  static std::vector<std::string> actions(const PlanningTable& table) {
    std::vector<std::string> out;
    for (const sim::PlanStep& step : table.session().plan().steps)
      out.emplace_back(sim::name_of(step.action));
    return out;
  }
  /// Where the first tool that holds something is.
  static sim::Pose held_pose(const PlanningTable& table) {
    const auto& poses = table.session().frame().poses;
    return std::ranges::find_if(poses, [](const auto& pose) { return pose.has_value(); })->value();
  }
  /// Until all tools are where their pointers are.
  static int settle(PlanningTable& table) {
    int steps = 0;
    while (steps < 200 && table.advance()) ++steps;
    return steps;
  }
  static PlanningListener silent_listener() {
    PlanningListener listener;
    listener.opening = [](const std::string& /*step*/) {};
    listener.opened = [](const PlanningTable& /*table*/) {};
    listener.ready = [] { return true; };
    listener.shown = [](const PlanningMoment& /*moment*/) {};
    listener.steps_changed = [](const PlanningTable& /*planned*/) {};
    listener.told = [](const std::string& /*sentence*/) {};
    listener.failed = [](const std::string& sentence) { ADD_FAILURE() << sentence; };
    return listener;
  }
  static std::string refusal(PlanningTable& table, const Deed& deed) {
    try {
      table.apply(deed);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  /// The saved plan, run from its beginning, ends where the table is.
  void expect_saved_plan_ends_here(PlanningTable& table, const std::string& name) const {
    const std::string file = plans_.save(table.opened(), name, table.document("By hand"));
    const sim::PlanReading reading = sim::read_plan(block_.folder() / file);
    ASSERT_THAT(reading.errors, IsEmpty());
    sim::PlanRun run(*reading.plan);
    while (run.next()) {
    }
    EXPECT_EQ(run.mesh().tetrahedra, table.session().mesh().tetrahedra);
    EXPECT_EQ((run.frame().displacement_m - table.session().frame().displacement_m).lpNorm<Eigen::Infinity>(),
              0);
  }

  test::PlannedBlock block_;
  PlanFolder plans_{block_.folder()};
};

TEST_F(PlanningTableTest, WhatIsDoneByPointersIsAPlanThatEndsThere) {
  const auto planned = table();
  planned->apply(ViewDeed{20, 15, 1.2, 0.05, -0.02});
  planned->apply(PointDeed{PointerUse::kGrasp, {{1, 0.62, 0.5, 0}}});
  EXPECT_THAT(actions(*planned), ElementsAre("grasp"));
  planned->apply(PointDeed{PointerUse::kGrasp, {{1, 0.66, 0.44, -0.004}}});
  EXPECT_GE(settle(*planned), 1);
  planned->apply(PointDeed{PointerUse::kGrasp, {}});
  EXPECT_THAT(actions(*planned), ElementsAre("grasp", "retract"));
  // Where the pointer went, there the forceps are.
  std::size_t held = 0;
  while (!planned->session().frame().poses[held]) ++held;
  const Eigen::Vector2d at = planned->on_picture(planned->session().frame().poses[held]->position_m);
  EXPECT_NEAR(at.x() - 0.62, 0.04, 0.03);
  EXPECT_NEAR(at.y() - 0.5, -0.06, 0.03);
  EXPECT_GT(planned->session().frame().tools[held].force_n.norm(), 0.01);
  // The same forceps are taken again.
  planned->apply(PointDeed{PointerUse::kGrasp, {{2, 0.66, 0.44, 0}}});
  planned->apply(PointDeed{PointerUse::kGrasp, {{2, 0.64, 0.44, 0}}});
  settle(*planned);
  planned->apply(PointDeed{PointerUse::kGrasp, {}});
  EXPECT_THAT(actions(*planned), ElementsAre("grasp", "retract", "retract"));
  planned->apply(PointDeed{PointerUse::kPress, {{3, 0.5, 0.48, 0.004}, {4, 0.4, 0.5, 0.004}}});
  settle(*planned);
  EXPECT_THAT(planned->take_remarks(), IsEmpty());
  planned->apply(CutDeed{{{0.46, 0.1}, {0.46, 0.9}}, 0.008});
  EXPECT_LT(planned->session().mesh().tetrahedra.size(),
            planned->session().plan().body.mesh.tetrahedra.size());
  planned->apply(HoldDeed{0.1});
  expect_saved_plan_ends_here(*planned, "by hand");
  EXPECT_THAT(actions(*planned),
              ElementsAre("grasp", "retract", "retract", "press", "release", "release", "cut", "hold"));
  // Never over another.
  EXPECT_THROW(static_cast<void>(plans_.save(planned->opened(), "by hand", planned->document("x"))), Refusal);
}

TEST_F(PlanningTableTest, JawsAreTurnedAboutTheLineOfSightAndTheTissueWithThem) {
  const auto planned = table();
  planned->apply(ViewDeed{20, 15, 1.2, 0, 0});
  planned->apply(PointDeed{PointerUse::kGrasp, {{1, 0.62, 0.5, 0}}});
  const auto pose = [&] { return held_pose(*planned); };
  const sim::Pose before = pose();
  planned->apply(PointDeed{PointerUse::kGrasp, {{1, 0.62, 0.5, 0, 30}}});
  const double step_s = planned->session().plan().time_step_s;
  EXPECT_TRUE(planned->advance());
  EXPECT_NEAR(before.orientation.angularDistance(pose().orientation), PointerTools::kMostTurnRadians * step_s,
              1e-6)
      << "no faster";
  settle(*planned);
  const Eigen::AngleAxisd turn(pose().orientation * before.orientation.conjugate());
  EXPECT_NEAR(turn.angle() * 180 / std::numbers::pi, 30, 0.1);
  EXPECT_LT((pose().position_m - before.position_m).norm(), 1e-4);
  // Clockwise: what is above the middle goes to the right.
  const auto seen = [&](const sim::Vector3& beside_m) {
    return Eigen::Vector2d(planned->on_picture(pose().position_m + beside_m));
  };
  const sim::Vector3 above_m(0, 0, 0.01);
  EXPECT_LT(seen(above_m).y(), seen(sim::Vector3::Zero()).y());
  EXPECT_GT(seen(turn * above_m).x(), seen(above_m).x() + 0.01);
  EXPECT_LT((seen(0.01 * turn.axis()) - seen(sim::Vector3::Zero())).norm(), 0.02)
      << "along the line of sight";
  EXPECT_GT(planned->session().frame().displacement_m.lpNorm<Eigen::Infinity>(), 1e-4);
  // The next pointer turns them on from where they are, whatever it was turned before it came down.
  planned->apply(PointDeed{PointerUse::kGrasp, {}});
  planned->apply(PointDeed{PointerUse::kGrasp, {{2, 0.62, 0.5, 0, 90}}});
  settle(*planned);
  EXPECT_LT(turn.angle() - before.orientation.angularDistance(pose().orientation), 1e-3);
  planned->apply(PointDeed{PointerUse::kGrasp, {{2, 0.62, 0.5, 0, 60}}});
  settle(*planned);
  EXPECT_LT(before.orientation.angularDistance(pose().orientation), 3e-3);
  planned->apply(PointDeed{PointerUse::kGrasp, {}});
  EXPECT_THAT(actions(*planned), ElementsAre("grasp", "retract", "retract"));
  expect_saved_plan_ends_here(*planned, "turned");
}

TEST_F(PlanningTableTest, JawsLeanAsAPenIsTiltedAndTheTissueWithThem) {
  const auto planned = table();
  planned->apply(ViewDeed{20, 15, 1.2, 0, 0});
  planned->apply(PointDeed{PointerUse::kGrasp, {{1, 0.62, 0.5, 0}}});
  const auto pose = [&] { return held_pose(*planned); };
  const sim::Pose before = pose();
  const auto seen = [&](const sim::Vector3& beside_m) {
    return Eigen::Vector2d(planned->on_picture(before.position_m + beside_m));
  };
  planned->apply(PointDeed{PointerUse::kGrasp, {{1, 0.62, 0.5, 0, 0, 30, 0}}});
  settle(*planned);
  const Eigen::AngleAxisd to_the_right(pose().orientation * before.orientation.conjugate());
  EXPECT_NEAR(to_the_right.angle() * 180 / std::numbers::pi, 30, 0.1);
  EXPECT_LT((pose().position_m - before.position_m).norm(), 1e-4);
  // About what is upright in the picture: the end towards the eye goes to the right, the tip to the left.
  const sim::Vector3 up = 0.01 * to_the_right.axis();
  EXPECT_NEAR(seen(up).x(), seen(sim::Vector3::Zero()).x(), 0.02);
  EXPECT_LT(seen(up).y(), seen(sim::Vector3::Zero()).y() - 0.01);
  EXPECT_GT(planned->session().frame().displacement_m.lpNorm<Eigen::Infinity>(), 1e-4);
  planned->apply(PointDeed{PointerUse::kGrasp, {{1, 0.62, 0.5, 0, 0, 0, 30}}});
  settle(*planned);
  const Eigen::AngleAxisd downwards(pose().orientation * before.orientation.conjugate());
  EXPECT_NEAR(downwards.angle() * 180 / std::numbers::pi, 30, 0.1);
  const sim::Vector3 right = 0.01 * downwards.axis();
  EXPECT_NEAR(seen(right).y(), seen(sim::Vector3::Zero()).y(), 0.02);
  EXPECT_GT(seen(right).x(), seen(sim::Vector3::Zero()).x() + 0.01);
  // Upright again, it lies as before; the next pen leans them on from where they are.
  planned->apply(PointDeed{PointerUse::kGrasp, {{1, 0.62, 0.5, 0}}});
  settle(*planned);
  EXPECT_LT(before.orientation.angularDistance(pose().orientation), 3e-3);
  planned->apply(PointDeed{PointerUse::kGrasp, {}});
  planned->apply(PointDeed{PointerUse::kGrasp, {{2, 0.62, 0.5, 0, 0, 40, 0}}});
  settle(*planned);
  EXPECT_LT(before.orientation.angularDistance(pose().orientation), 3e-3);
  planned->apply(PointDeed{PointerUse::kGrasp, {}});
  expect_saved_plan_ends_here(*planned, "leant");
}

TEST_F(PlanningTableTest, BothJawsMeetTheTissueOrNoneIsHeld) {
  // Of a coarse mesh few nodes of the surface come before the jaws, and inner ones as often.
  const test::PlannedBlock coarse({4, 2, 2});
  PlanFolder plans(coarse.folder());
  PlanningTable planned(plans.open("block/plan.json", [](const std::string& /*step*/) {}), true, kSmall,
                        [](double /*time_s*/) {});
  std::size_t held = 0;
  for (const auto& [azimuth, elevation] :
       {std::pair(0.0, 0.0), std::pair(20.0, 15.0), std::pair(50.0, -25.0)}) {
    planned.apply(ViewDeed{azimuth, elevation, 1.2, 0, 0});
    for (std::uint32_t i = 0; i < 40; ++i) {
      const double x = 0.3 + 0.04 * (i % 10), y = 0.4 + 0.06 * (i / 10);
      if (!refusal(planned, PointDeed{PointerUse::kPinch, {{i + 1, x, y, 0}}}).empty() ||
          actions(planned).empty())
        continue;
      std::size_t tool = 0;
      while (!planned.session().frame().poses[tool]) ++tool;
      for (const auto& jaw : planned.session().frame().grips[tool].grip.jaws)
        EXPECT_GT(jaw.nodes, 0U) << "at " << x << ", " << y << " from " << azimuth;
      ++held;
      planned.apply(PointDeed{PointerUse::kPinch, {}});
      while (!actions(planned).empty()) planned.apply(UndoDeed{});
    }
  }
  EXPECT_GT(held, 10U);
}

TEST_F(PlanningTableTest, JawsCloseOnTheTissueHoldItAndLoseItWhenPulledTooHard) {
  const auto planned = table();
  planned->apply(ViewDeed{0, 0, 1.2, 0, 0});
  planned->apply(PointDeed{PointerUse::kPinch, {{1, 0.62, 0.5, 0}}});
  ASSERT_THAT(actions(*planned), ElementsAre("close"));
  std::size_t held = 0;
  while (!planned->session().frame().poses[held]) ++held;
  const std::string name = planned->session().plan().tools[held].tool.name;
  EXPECT_EQ(name, "grasper 1");
  const auto grip = [&] { return planned->session().frame().grips[held]; };
  const sim::PlanGrip first = grip();
  EXPECT_GT(first.grip.squeeze_n, 0.01);
  EXPECT_GT(first.grip.jaws[0].nodes, 0U);
  EXPECT_GT(first.grip.jaws[1].nodes, 0U);
  // Closer together, while the pointer keeps them.
  planned->apply(CloseDeed{name, 0.9});
  EXPECT_NEAR(grip().opening_m / first.opening_m, 0.9, 1e-6);
  EXPECT_GT(grip().grip.squeeze_n, first.grip.squeeze_n);
  planned->apply(PointDeed{PointerUse::kPinch, {{1, 0.63, 0.5, 0}}});
  settle(*planned);
  planned->apply(PointDeed{PointerUse::kPinch, {}});
  EXPECT_THAT(planned->take_remarks(), IsEmpty()) << "held";
  // The page is told of it with each picture.
  sim::Picture picture = planned->picture(1);
  PlanningMoment moment;
  moment.table = planned.get();
  moment.picture = &picture;
  const auto told = [&] {
    const Bytes message = moment_message(moment);
    const auto length =
        std::to_integer<std::ptrdiff_t>(message[0]) + 256 * std::to_integer<std::ptrdiff_t>(message[1]);
    std::string text;
    for (std::ptrdiff_t i = 0; i < length; ++i)
      text += std::to_integer<char>(message[static_cast<std::size_t>(4 + i)]);
    return nlohmann::json::parse(text).at("tools").at(0);
  };
  EXPECT_EQ(told()["jaws"]["opening_m"], grip().opening_m);
  EXPECT_EQ(told()["jaws"]["slips"], false);
  // Taken again where they are, and pulled too hard.
  const Eigen::Vector2d at = planned->on_picture(planned->session().frame().poses[held]->position_m);
  planned->apply(PointDeed{PointerUse::kPinch, {{2, at.x(), at.y(), 0}}});
  bool slipped = false;
  for (int i = 1; i <= 30 && !slipped; ++i) {
    planned->apply(PointDeed{PointerUse::kPinch, {{2, at.x() + 0.01 * i, at.y(), 0}}});
    settle(*planned);
    slipped = told()["jaws"]["slips"] == true;
  }
  planned->apply(PointDeed{PointerUse::kPinch, {}});
  EXPECT_TRUE(slipped);
  EXPECT_THAT(planned->take_remarks(), testing::Contains(HasSubstr("the tissue slips in 'grasper 1'")));
  EXPECT_THAT(actions(*planned), ElementsAre("close", "close", "retract", "retract"));
  expect_saved_plan_ends_here(*planned, "pinched");
  // A grasper opens no further than it does, and has to be there.
  for (int i = 0; i < 2; ++i) planned->apply(CloseDeed{name, 2});
  EXPECT_THAT(refusal(*planned, CloseDeed{name, 2}), HasSubstr("the jaws of 'grasper 1' open no further"));
  EXPECT_EQ(grip().opening_m, planned->session().plan().tools[held].opening_m);
  EXPECT_EQ(grip().grip.squeeze_n, 0);
  planned->apply(ReleaseDeed{name});
  EXPECT_THAT(refusal(*planned, CloseDeed{name, 0.9}), HasSubstr("'grasper 1' is not at the organ"));
}

TEST_F(PlanningTableTest, AClipIsPutOnLeftUndoneAndSaved) {
  const auto planned = table();
  planned->apply(ViewDeed{0, 0, 1.2, 0, 0});
  planned->apply(PointDeed{PointerUse::kClip, {{1, 0.62, 0.5, 0}}});
  planned->apply(PointDeed{PointerUse::kClip, {}});
  ASSERT_THAT(actions(*planned), ElementsAre("close"));
  const auto& session = planned->session();
  const auto& tools = session.plan().tools;
  const auto number = static_cast<std::size_t>(
      std::ranges::find(tools, "clip 1", [](const sim::PlanTool& one) { return one.tool.name; }) -
      tools.begin());
  ASSERT_TRUE(session.frame().poses[number]);
  planned->apply(CloseDeed{"clip 1", 0.9});
  planned->apply(ReleaseDeed{"clip 1"});
  EXPECT_THAT(actions(*planned), ElementsAre("close", "close", "release"));
  EXPECT_TRUE(session.frame().grips[number].left);
  EXPECT_GT(session.frame().grips[number].grip.squeeze_n, 0.01);
  // Another pointer there neither takes it nor moves it, and no deed uses it again.
  EXPECT_THAT(refusal(*planned, ReleaseDeed{"clip 1"}), HasSubstr("a clip is used once"));
  EXPECT_THAT(refusal(*planned, CloseDeed{"clip 1", 0.9}), HasSubstr("a clip is used once"));
  expect_saved_plan_ends_here(*planned, "clipped");
  planned->apply(UndoDeed{});
  EXPECT_FALSE(session.frame().grips[number].left);
  planned->apply(RedoDeed{});
  EXPECT_TRUE(session.frame().grips[number].left);
}

TEST_F(PlanningTableTest, GoesOnWithAPlanAndUndoesItsStepsToo) {
  const auto planned = table(false);
  EXPECT_THAT(actions(*planned), ElementsAre("grasp", "retract"));
  planned->apply(HoldDeed{0.1});
  expect_saved_plan_ends_here(*planned, "held");
  for (int i = 0; i < 3; ++i) planned->apply(UndoDeed{});
  EXPECT_THAT(actions(*planned), IsEmpty());
  planned->apply(UndoDeed{});
  planned->apply(RedoDeed{});
  planned->apply(RedoDeed{});
  EXPECT_THAT(actions(*planned), ElementsAre("grasp", "retract"));
}

TEST_F(PlanningTableTest, RefusesInWordsAndGoesOn) {
  const auto planned = table();
  EXPECT_THAT(refusal(*planned, CutDeed{{{0.01, 0.01}, {0.02, 0.02}}, 0.01}),
              HasSubstr("does not cross the organ"));
  EXPECT_THAT(refusal(*planned, ReleaseDeed{"needle"}), HasSubstr("no tool of that name"));
  EXPECT_THAT(refusal(*planned, ReleaseDeed{"finger 1"}), HasSubstr("not at the organ"));
  // Beside the organ a pointer does nothing.
  planned->apply(PointDeed{PointerUse::kGrasp, {{1, 0.01, 0.01, 0}}});
  EXPECT_FALSE(planned->advance());
  EXPECT_THAT(actions(*planned), IsEmpty());
  EXPECT_THROW(static_cast<void>(planned->document("nothing")), Error);
  // A finger that does not reach the tissue makes no step.
  planned->apply(PointDeed{PointerUse::kPress, {{2, 0.5, 0.5, -0.02}}});
  settle(*planned);
  planned->apply(PointDeed{PointerUse::kPress, {}});
  EXPECT_THAT(planned->take_remarks(), ElementsAre(HasSubstr("'finger 1' never touched")));
  EXPECT_THAT(actions(*planned), IsEmpty());
}

TEST_F(PlanningTableTest, ShowsStressSizeAndCuts) {
  const auto planned = table(false);
  const sim::Picture plain = planned->picture(1);
  EXPECT_EQ(plain.width, 96);
  EXPECT_EQ(planned->picture(0.5).width, 48);
  planned->apply(StressDeed{2000});
  EXPECT_NE(planned->picture(1).rgb, plain.rgb);
  planned->apply(StressDeed{});
  EXPECT_EQ(planned->picture(1).rgb, plain.rgb);
  planned->apply(CutDeed{{{0.46, 0.1}, {0.46, 0.9}}, 0.008});
  EXPECT_NE(planned->picture(1).rgb, plain.rgb);
  planned->apply(UndoDeed{});
  EXPECT_EQ(planned->picture(1).rgb, plain.rgb);
}

TEST_F(PlanningTableTest, ACutThatWasDrawnIsChangedByItsHandlesOnThePicture) {
  const auto planned = table();
  planned->apply(CutDeed{{{0.46, 0.4}, {0.46, 0.5}, {0.46, 0.6}}, 0.006});
  ASSERT_THAT(planned->cuts(), SizeIs(1));
  const ShownCut drawn = planned->cuts()[0];
  ASSERT_GE(drawn.handles.size(), 2U);
  const std::size_t last = drawn.handles.size() - 1;
  EXPECT_NEAR(drawn.handles[0].x, 0.46, 0.01);
  EXPECT_NEAR(drawn.handles[0].y, 0.4, 0.01);
  EXPECT_NEAR(drawn.handles[last].x, 0.46, 0.01);
  EXPECT_NEAR(drawn.handles[last].y, 0.6, 0.01);
  for (const ShownHandle& handle : drawn.handles) {
    EXPECT_NEAR(handle.depth_m, 0.006, 1e-9);
    EXPECT_FALSE(handle.hidden);
  }
  const sim::Picture as_drawn = planned->picture(1);
  planned->apply(HandleDeed{0, last, Eigen::Vector2d(0.56, 0.62), {}});
  planned->apply(HandleDeed{0, 0, {}, 0.009});
  const ShownCut changed = planned->cuts()[0];
  EXPECT_NEAR(changed.handles[last].x, 0.56, 0.01);
  EXPECT_NEAR(changed.handles[last].y, 0.62, 0.01);
  EXPECT_NEAR(changed.handles[last].depth_m, 0.006, 1e-9);
  EXPECT_NEAR(changed.handles[0].x, drawn.handles[0].x, 0.01);
  EXPECT_NEAR(changed.handles[0].depth_m, 0.009, 1e-9);
  EXPECT_NE(planned->picture(1).rgb, as_drawn.rgb);
  EXPECT_THAT(actions(*planned), ElementsAre("cut"));
  // As if it had been drawn so on the body that was never cut.
  const auto at_once = table();
  const sim::PlanStep& step = planned->session().plan().steps[0];
  sim::PlanSession session(at_once->session().plan());
  session.cut(step.motions.front().tool, *step.curve);
  EXPECT_EQ(session.mesh().tetrahedra, planned->session().mesh().tetrahedra);
  EXPECT_EQ(session.mesh().nodes, planned->session().mesh().nodes);
  EXPECT_EQ(session.frame().displacement_m, planned->session().frame().displacement_m);
  expect_saved_plan_ends_here(*planned, "changed");
  planned->apply(UndoDeed{});
  EXPECT_NEAR(planned->cuts()[0].handles[0].depth_m, 0.006, 1e-9);
  EXPECT_NEAR(planned->cuts()[0].handles[last].x, 0.56, 0.01);
  planned->apply(UndoDeed{});
  EXPECT_EQ(planned->picture(1).rgb, as_drawn.rgb);
  planned->apply(RedoDeed{});
  planned->apply(RedoDeed{});
  EXPECT_EQ(session.frame().displacement_m, planned->session().frame().displacement_m);
}

TEST_F(PlanningTableTest, HandlesMoveWithTheOrganAndHideBehindIt) {
  const auto planned = table(false);
  planned->apply(CutDeed{{{0.46, 0.45}, {0.46, 0.6}}, 0.004});
  const sim::CutCurve curve = *planned->session().plan().steps.back().curve;
  const auto handles = [&] { return planned->cuts()[0].handles; };
  const double before_y = handles()[0].y;
  // The clamp holds the block's end, and lifts it.
  planned->apply(PointDeed{PointerUse::kGrasp, {{1, 0.72, 0.42, 0}}});
  planned->apply(PointDeed{PointerUse::kGrasp, {{1, 0.72, 0.3, 0}}});
  settle(*planned);
  planned->apply(PointDeed{PointerUse::kGrasp, {}});
  ASSERT_GT(planned->session().frame().displacement_m.lpNorm<Eigen::Infinity>(), 0.004);
  EXPECT_LT(handles()[0].y, before_y - 0.01) << "the handle lies on the organ as it lies";
  for (const ShownHandle& handle : handles()) EXPECT_FALSE(handle.hidden);
  // Dragged nowhere it stays where it was in the rest shape, however the organ lies.
  const sim::Vector3 rest_m = curve.handles_m[0];
  const ShownHandle first = handles()[0];
  planned->apply(HandleDeed{2, 0, Eigen::Vector2d(first.x, first.y), {}});
  EXPECT_LT((planned->session().plan().steps[2].curve->handles_m[0] - rest_m).norm(), 1e-3);
  planned->apply(ViewDeed{180, 0, 1, 0, 0});
  for (const ShownHandle& handle : handles()) EXPECT_TRUE(handle.hidden);
}

TEST_F(PlanningTableTest, RefusesHandlesThatLeaveTheOrganAndKeepsTheCut) {
  const auto planned = table();
  planned->apply(CutDeed{{{0.46, 0.4}, {0.46, 0.6}}, 0.006});
  const Eigen::VectorXd before = planned->session().frame().displacement_m;
  const auto curve = planned->session().plan().steps[0].curve;
  const std::size_t last = curve->handles_m.size() - 1;
  EXPECT_THAT(refusal(*planned, HandleDeed{0, last, Eigen::Vector2d(0.02, 0.02), {}}),
              testing::Eq("handle " + std::to_string(last + 1) +
                          " would leave the organ: drag it to a place on its surface"));
  const ShownHandle first = planned->cuts()[0].handles[0];
  EXPECT_THAT(refusal(*planned, HandleDeed{0, last, Eigen::Vector2d(first.x, first.y), {}}),
              HasSubstr("would lie at handle 1: leave at least"));
  EXPECT_THAT(refusal(*planned, HandleDeed{0, 0, {}, 0.2}), HasSubstr("needs a blade whose edge is longer"));
  EXPECT_THAT(refusal(*planned, HandleDeed{0, last + 1, {}, 0.01}), HasSubstr("that handle is gone"));
  EXPECT_THAT(refusal(*planned, HandleDeed{3, 0, {}, 0.01}), HasSubstr("that handle is gone"));
  EXPECT_EQ(planned->session().frame().displacement_m, before);
  EXPECT_EQ(planned->session().plan().steps[0].curve->handles_m, curve->handles_m);
  // Over the border the organ is divided, without handles; on it too short a line is none.
  planned->apply(UndoDeed{});
  EXPECT_THAT(refusal(*planned, CutDeed{{{0.46, 0.5}, {0.4601, 0.5}}, 0.006}), HasSubstr("too short"));
  planned->apply(CutDeed{{{0.46, 0.1}, {0.46, 0.9}}, 0.006});
  EXPECT_THAT(planned->cuts(), IsEmpty());
  EXPECT_THAT(planned->take_remarks(), testing::Contains(HasSubstr("goes over the organ's border")));
}

TEST_F(PlanningTableTest, ALineThatLeavesTheOrganInBetweenDividesItAndSaysSo) {
  const auto planned = table();
  planned->apply(CutDeed{{{0.44, 0.5}, {0.44, 0.02}, {0.5, 0.02}, {0.5, 0.5}}, 0.006});
  EXPECT_THAT(planned->cuts(), IsEmpty());
  EXPECT_THAT(planned->take_remarks(), testing::Contains(HasSubstr("goes over the organ's border")));
  EXPECT_THAT(actions(*planned), ElementsAre("cut"));
}

TEST_F(PlanningTableTest, PlacesThatFollowNoSurfaceMakeNoCurve) {
  const auto planned = table();
  const sim::TetMesh& block = planned->session().plan().body.mesh;
  const double edge_m = sim::mean_surface_edge_m(block);
  const auto on_top = [](double x_m) { return sim::Vector3(x_m, 0.01, 0.02); };
  EXPECT_TRUE(curve_through({on_top(0.01), on_top(0.02), on_top(0.03)}, 0.004, block));
  EXPECT_TRUE(curve_through({on_top(0.01), on_top(0.01 + 2.9 * edge_m)}, 0.004, block));
  EXPECT_FALSE(curve_through({on_top(0.01), on_top(0.01 + 3.1 * edge_m)}, 0.004, block)) << "a jump";
  // Each step is short, and the middle lies in the block, as the wall of an open cut does.
  const sim::Vector3 inside_m(0.02, 0.01, 0.02 - 1.2 * edge_m);
  EXPECT_FALSE(curve_through({on_top(0.012), inside_m, on_top(0.028)}, 0.004, block)) << "deep in a cut";
}

TEST_F(PlanningTableTest, OpensAndSavesWithinItsFolderOnly) {
  ASSERT_THAT(plans_.plans(), SizeIs(1));
  EXPECT_EQ(plans_.plans()[0].file, "block/plan.json");
  EXPECT_EQ(plans_.plans()[0].steps, 2U);
  EXPECT_TRUE(plans_.plans()[0].has_volume);
  const auto opening = [](const std::string& /*step*/) {};
  for (const char* const name :
       {"../plan.json", "block/../block/plan.json", "/etc/passwd", "block/ct.nrrd", ""})
    EXPECT_THROW(static_cast<void>(plans_.open(name, opening)), Refusal) << name;
  const auto planned = table(false);
  planned->apply(HoldDeed{0.1});
  for (const char* const name : {"../plan", "a/b", "", ".hidden", " x", "a\nb"})
    EXPECT_THROW(static_cast<void>(plans_.save(planned->opened(), name, planned->document("x"))), Refusal)
        << name;
  EXPECT_THAT(plans_.plans(), SizeIs(1));
}

TEST_F(PlanningTableTest, LivePlanningTellsPicturesAndStepsUntilItEnds) {
  std::mutex mutex;
  std::condition_variable changed;
  std::uint64_t shown = 0;
  std::size_t steps = 0;
  std::vector<std::string> told;
  PlanningListener listener;
  listener.opening = [](const std::string& /*step*/) {};
  listener.opened = [](const PlanningTable& /*table*/) {};
  listener.ready = [] { return true; };
  listener.shown = [&](const PlanningMoment& moment) {
    const std::lock_guard guard(mutex);
    shown = moment.input;
    changed.notify_all();
  };
  listener.steps_changed = [&](const PlanningTable& planned) {
    const std::lock_guard guard(mutex);
    steps = planned.session().plan().steps.size();
  };
  listener.told = [&](const std::string& sentence) {
    const std::lock_guard guard(mutex);
    told.push_back(sentence);
  };
  listener.failed = listener.told;
  LivePlanning planning([this](const LivePlanning::Opening& /*opening*/) { return table(); }, listener);
  EXPECT_TRUE(planning.apply(1, HoldDeed{0.1}));
  EXPECT_TRUE(planning.apply(2, ReleaseDeed{"needle"}));
  EXPECT_TRUE(planning.apply(3, PointDeed{PointerUse::kGrasp, {{1, 0.62, 0.5, 0}}}));
  EXPECT_TRUE(planning.apply(4, PointDeed{PointerUse::kGrasp, {{1, 0.66, 0.44, 0}}}));
  EXPECT_TRUE(planning.apply(5, PointDeed{PointerUse::kGrasp, {}}));
  std::unique_lock lock(mutex);
  ASSERT_TRUE(changed.wait_for(lock, std::chrono::seconds(60), [&] { return shown == 5; }));
  EXPECT_THAT(told, ElementsAre("there is no tool of that name"));
  EXPECT_EQ(steps, 2U);
  lock.unlock();
  // Once the next picture is there, what the one before it took is known.
  EXPECT_TRUE(planning.apply(6, ViewDeed{}));
  lock.lock();
  ASSERT_TRUE(changed.wait_for(lock, std::chrono::seconds(60), [&] { return shown == 6; }));
  EXPECT_GT(planning.input_to_picture().longest().count(), 0);
}

TEST_F(PlanningTableTest, LivePlanningMovesToolsByItsClock) {
  test::MovedClock clock;
  std::atomic<int> pictures = 0;
  PlanningListener listener = silent_listener();
  listener.shown = [&](const PlanningMoment& /*moment*/) { ++pictures; };
  LivePlanning planning([this](const LivePlanning::Opening& /*opening*/) { return table(); }, listener,
                        clock);
  EXPECT_TRUE(planning.apply(1, PointDeed{PointerUse::kGrasp, {{1, 0.62, 0.5, 0}}}));
  EXPECT_TRUE(planning.apply(2, PointDeed{PointerUse::kGrasp, {{1, 0.66, 0.44, 0}}}));
  // The tool is on its way, and waits for the time of its next step.
  clock.await_waiting(1);
  const int before = pictures;
  clock.move(std::chrono::milliseconds(49));
  clock.await_waiting(1);
  EXPECT_EQ(pictures, before);
  clock.move(std::chrono::milliseconds(1));
  EXPECT_TRUE(test::eventually([&] { return pictures == before + 1; }));
}

TEST_F(PlanningTableTest, LivePlanningShowsAFinePictureOnceNothingMoves) {
  test::MovedClock clock;
  std::mutex mutex;
  std::vector<sim::Picture> pictures;
  std::uint64_t shown = 0;
  const auto count = [&] {
    const std::lock_guard guard(mutex);
    return pictures.size();
  };
  PlanningListener listener = silent_listener();
  listener.shown = [&](const PlanningMoment& moment) {
    const std::lock_guard guard(mutex);
    pictures.push_back(*moment.picture);
    shown = moment.input;
  };
  LivePlanning planning([this](const LivePlanning::Opening& /*opening*/) { return table(); }, listener,
                        clock);
  EXPECT_TRUE(planning.apply(1, ViewDeed{30, 0, 1, 0, 0}));
  ASSERT_TRUE(test::eventually([&] {
    const std::lock_guard guard(mutex);
    return shown == 1;
  }));
  clock.await_waiting(1);
  const std::size_t before = count();
  clock.move(std::chrono::milliseconds(199));
  clock.await_waiting(1);
  EXPECT_EQ(count(), before);
  clock.move(std::chrono::milliseconds(1));
  ASSERT_TRUE(test::eventually([&] { return count() == before + 1; }));
  const auto planned = table();
  planned->apply(ViewDeed{30, 0, 1, 0, 0});
  EXPECT_EQ(pictures.back().rgb, planned->picture(1).rgb);
  EXPECT_EQ(pictures[before - 1].rgb, planned->picture(1, true).rgb);
  EXPECT_NE(pictures.back().rgb, pictures[before - 1].rgb);
}

TEST_F(PlanningTableTest, LivePlanningAsksABrowserThatIsBehindByItsClock) {
  test::MovedClock clock;
  std::atomic<int> pictures = 0, asked = 0;
  std::atomic<bool> is_ready = false;
  PlanningListener listener = silent_listener();
  listener.ready = [&] {
    ++asked;
    return is_ready.load();
  };
  listener.shown = [&](const PlanningMoment& /*moment*/) { ++pictures; };
  const LivePlanning planning([this](const LivePlanning::Opening& /*opening*/) { return table(); }, listener,
                              clock);
  clock.await_waiting(1);
  const int before = asked;
  clock.move(std::chrono::milliseconds(3));
  clock.await_waiting(1);
  EXPECT_EQ(asked, before) << "however long that takes";
  clock.move(std::chrono::milliseconds(1));
  clock.await_waiting(1);
  EXPECT_GT(asked, before);
  EXPECT_EQ(pictures, 0);
  is_ready = true;
  clock.move(std::chrono::milliseconds(4));
  EXPECT_TRUE(test::eventually([&] { return pictures == 1; }));
}

}  // namespace
}  // namespace kiroku::viewer
