#include "sim/plan/plan_run.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "sim/mesh/mesh_writer.h"
#include "sim/plan/plan_frames.h"
#include "sim/plan/plan_report.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

/// A block of 40 x 20 x 20 mm held at x = 0, with node i + 9 j + 45 k at (5 i, 5 j, 5 k) mm.
class PlanRunTest : public testing::Test {
 protected:
  PlanRunTest() {
    std::ofstream(folder_ / "block.msh")
        << msh_text(test::tet_grid({8, 4, 4}, {0.04, 0.02, 0.02}), LengthUnit::kMillimetre);
  }
  [[nodiscard]] Plan plan_of(const char* steps, bool corotational = false) const {
    json document = json::parse(R"({
      "mesh": "block.msh", "length_unit": "mm", "time_step_s": 0.25,
      "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.4}],
      "fixed": [{"box": [[0, 0, 0], [0, 20, 20]]}],
      "tools": {"forceps": {"kind": "forceps", "jaws": [2, 30, 30]}, "thumb": {"kind": "finger", "radius": 5},
                "index": {"kind": "finger", "radius": 5}, "knife": {"kind": "scalpel", "edge": 40}}})");
    if (corotational) document["corotational"] = true;
    document["steps"] = json::parse(steps);
    std::ofstream(folder_ / "plan.json") << document;
    PlanReading reading = read_plan(folder_ / "plan.json");
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

  test::TemporaryFolder folder_;
};

constexpr std::size_t kForcepsTool = 0, kIndexTool = 1, kKnifeTool = 2, kThumbTool = 3;  // tools go by name

TEST_F(PlanRunTest, GraspsRetractsAndReleases) {
  const Plan plan = plan_of(R"([
    {"do": "grasp", "tool": "forceps", "at": {"position": [40, 10, 10]}},
    {"do": "retract", "tool": "forceps", "path": [{"at_s": 1, "position": [42, 10, 13]}]},
    {"do": "hold", "duration_s": 0.5}, {"do": "release", "tool": "forceps"}])");
  PlanRun run(plan);
  std::vector<double> times;
  const Eigen::Index end = 3 * (8 + 9 * 2 + 45 * 2);
  while (run.next()) {
    const PlanFrame& frame = run.frame();
    times.push_back(frame.time_s);
    if (times.size() == 6) {  // the end of the retraction
      EXPECT_LT((frame.displacement_m.segment<3>(end) - Vector3(0.002, 0, 0.003)).norm(), 1e-12);
      // The tissue pulls the forceps back.
      EXPECT_LT(frame.tools[kForcepsTool].force_n.x(), -1e-3);
      EXPECT_LT(frame.tools[kForcepsTool].force_n.z(), -1e-3);
      EXPECT_EQ(frame.tools[kForcepsTool].nodes, 25U);
    }
  }
  EXPECT_THAT(times, testing::ElementsAre(0, 0, 0.25, 0.5, 0.75, 1, 1.25, 1.5, 1.5));
  EXPECT_LT(run.frame().displacement_m.norm(), 1e-12);
  EXPECT_FALSE(run.frame().poses[kForcepsTool].has_value());
  ASSERT_THAT(run.figures(), SizeIs(4));
  EXPECT_EQ(run.figures()[1].frames, 4U);
  EXPECT_EQ(run.figures()[2].begins_s, 1);
  EXPECT_NEAR(run.figures()[1].largest_displacement_m, std::hypot(0.002, 0.003), 1e-3);
}

TEST_F(PlanRunTest, PressesWithTwoFingersAtOnce) {
  const Plan plan = plan_of(R"([{"do": "press", "tools": {
      "thumb": [{"at_s": 0, "position": [30, 10, 26]}, {"at_s": 1, "position": [30, 10, 23]}],
      "index": [{"at_s": 0, "position": [30, 10, -6]}, {"at_s": 1, "position": [30, 10, -3]}]}}])");
  PlanRun run(plan);
  while (run.next()) {
  }
  const PlanFrame& frame = run.frame();
  EXPECT_GT(frame.tools[kThumbTool].force_n.z(), 0.01);
  EXPECT_LT(frame.tools[kIndexTool].force_n.z(), -0.01);
  EXPECT_GT(frame.tools[kThumbTool].nodes, 0U);
  EXPECT_THAT(run.figures().back().remarks, IsEmpty());
}

TEST_F(PlanRunTest, CutsAndTheCutOpensWhenPulled) {
  const char* const kSteps = R"([
    {"do": "grasp", "tool": "forceps", "at": {"position": [40, 10, 10]}},
    {"do": "retract", "tool": "forceps", "path": [{"at_s": 1, "position": [43, 10, 10]}]},
    {"do": "cut", "tool": "knife", "path": [{"at_s": 0, "position": [22.3, -10, 30]}, {"at_s": 1, "position": [22.3, -10, 10.7]}]}])";
  // Its edge along y.
  json steps = json::parse(kSteps);
  steps[2]["path"][0]["rotation"] = {{"axis", {1, 0, 0}}, {"degrees", -90}};
  const Plan plan = plan_of(steps.dump().c_str());
  PlanRun run(plan);
  double before_n = 0;
  while (run.next()) {
    if (run.frame().step == 1) before_n = run.frame().tools[kForcepsTool].force_n.norm();
  }
  const StepFigures& figures = run.figures().back();
  EXPECT_GT(figures.tetrahedra_removed, 10U);
  EXPECT_LT(figures.volume_lost_m3, 0.1 * 0.04 * 0.02 * 0.02);
  EXPECT_EQ(run.mesh().nodes.size(), plan.body.mesh.nodes.size());
  EXPECT_EQ(run.mesh().tetrahedra.size(), plan.body.mesh.tetrahedra.size() - figures.tetrahedra_removed);
  // Half of what held the end is cut through.
  EXPECT_LT(run.frame().tools[kForcepsTool].force_n.norm(), 0.75 * before_n);
  EXPECT_EQ(run.frame().tools[kForcepsTool].nodes, 25U);
  // The tops of both faces of the cut, apart.
  double left = 0, right = 1;
  for (std::size_t node = 0; node < run.mesh().nodes.size(); ++node) {
    const Vector3& rest = run.mesh().nodes[node];
    if (rest.z() < 0.0199 || std::abs(rest.x() - 0.0223) > 1e-4) continue;
    const double x = rest.x() + run.frame().displacement_m[static_cast<Eigen::Index>(3 * node)];
    (run.frame().displacement_m[static_cast<Eigen::Index>(3 * node)] < 0.0008 ? left : right) = x;
  }
  EXPECT_GT(right - left, 0.001);
}

/// On the block's upper side, across it.
constexpr const char* kDrawnCut =
    R"({"do": "cut", "tool": "knife", "curve": {"through": [[22.3, -0.1, 20], [22.6, 10, 20], [22.3, 20.1, 20]],
                                               "depth": DEPTH}})";
std::string drawn_cut(const char* depth) {
  std::string text = kDrawnCut;
  return text.replace(text.find("DEPTH"), 5, depth);
}
constexpr const char* kPulled =
    R"({"do": "grasp", "tool": "forceps", "at": {"position": [40, 10, 10]}},
       {"do": "retract", "tool": "forceps", "path": [{"at_s": 1, "position": [43, 10, 10]}]})";

double left_m3(const PlanRun& run) {
  double sum_m3 = 0;
  for (std::size_t t = 0; t < run.mesh().tetrahedra.size(); ++t) sum_m3 += signed_volume_m3(run.mesh(), t);
  return sum_m3;
}

/// How much farther the upper edge is stretched between x = 15 and 30 mm than the lower one.
double opening_m(const PlanRun& run) {
  const auto moved_m = [&](int i, int k) {
    return run.frame().displacement_m[static_cast<Eigen::Index>(3 * (i + 9 * 2 + 45 * k))];
  };
  return moved_m(6, 4) - moved_m(3, 4) - (moved_m(6, 0) - moved_m(3, 0));
}

TEST_F(PlanRunTest, ACutThatIsDrawnIsMadeInTheRestShapeHoweverTheOrganLies) {
  // First pulled, then cut; and the other way round: the same shape is left, and it lies the same way.
  const Plan later = plan_of(("[" + std::string(kPulled) + "," + drawn_cut("9") + "]").c_str());
  PlanRun pulled(later);
  bool shown = false;
  while (pulled.next()) {
    const OptionalPose& knife = pulled.frame().poses[kKnifeTool];
    if (!knife) continue;
    shown = true;
    // The picture shows the blade where the pulled tissue is, farther from what holds it.
    EXPECT_GT(knife->position_m.x(), 0.0232);
    EXPECT_NEAR(knife->position_m.z(), 0.011, 0.001);
  }
  EXPECT_TRUE(shown);
  const Plan first = plan_of(("[" + drawn_cut("9") + "," + kPulled + "]").c_str());
  PlanRun cut(first);
  while (cut.next()) {
  }
  EXPECT_EQ(pulled.mesh().nodes, cut.mesh().nodes);
  EXPECT_EQ(pulled.mesh().tetrahedra, cut.mesh().tetrahedra);
  EXPECT_LT((pulled.frame().displacement_m - cut.frame().displacement_m).norm(), 1e-9);
  EXPECT_GT(opening_m(pulled), 5e-4);
}

TEST_F(PlanRunTest, ADeeperCutOpensFarther) {
  double before_m = 0;
  for (const char* depth : {"5", "10", "15", "[5, 15, 5]"}) {
    const Plan plan = plan_of(("[" + drawn_cut(depth) + "," + kPulled + "]").c_str());
    PlanRun run(plan);
    while (run.next()) {
    }
    const double now_m = opening_m(run);
    if (depth[0] == '[') {
      EXPECT_LT(now_m, before_m) << "less deep than all of it at 15 mm";
    } else {
      EXPECT_GT(now_m, 1.1 * before_m) << depth;
    }
    EXPECT_GT(left_m3(run), 0.85 * 0.04 * 0.02 * 0.02);
    before_m = now_m;
  }
}

TEST_F(PlanRunTest, ACurveThatCannotBeCutIsToldWithItsPath) {
  const auto errors = [&](const std::string& curve) {
    json document = json::parse(R"({
      "mesh": "block.msh", "length_unit": "mm",
      "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.4}],
      "fixed": [{"box": [[0, 0, 0], [0, 20, 20]]}], "tools": {"knife": {"kind": "scalpel", "edge": 40}}})");
    document["steps"] = json::parse(R"([{"do": "cut", "tool": "knife"}])");
    document["steps"][0].update(json::parse(curve));
    return read_plan_text(document.dump(), folder_ / "plan.json").errors;
  };
  const auto one = [](const std::string& text) { return testing::ElementsAre(HasSubstr(text)); };
  EXPECT_THAT(errors("{}"), one("steps[0] must have either 'path', where the scalpel goes, or 'curve'"));
  EXPECT_THAT(
      errors(R"({"curve": {"through": [[20, 0, 20], [20, 20, 20]], "depth": 50}})"),
      one("steps[0].curve cannot be cut: a depth of 50 mm needs a blade whose edge is longer: it has 40 mm"));
  EXPECT_THAT(errors(R"({"curve": {"through": [[20, 0, 20], [20, 20, 60]], "depth": 5}})"),
              one("steps[0].curve cannot be cut: handle 1 is 40 mm off the organ's surface"));
  EXPECT_THAT(errors(R"({"curve": {"through": [[20, 0, 20], [20, 20, 20]], "depth": -5}})"),
              one("steps[0].curve.depth is -5: it must be greater than 0"));
  EXPECT_THAT(errors(R"({"curve": {"through": [[20, 0, 20], [20, 20, 20]], "depth": 5, "shape": "arc"}})"),
              one("steps[0].curve.shape is 'arc': it must be one of spline, polyline"));
  EXPECT_THAT(
      errors(R"({"curve": {"through": [[20, 0, 20], [20, 20, 20]], "depth": 5, "direction": [0, 0, 1]}})"),
      one("steps[0].curve cannot be cut: the direction of the cut leads along the organ's surface or out"));
}

TEST_F(PlanRunTest, ACorotationalOrganIsCutWhileItIsHeld) {
  // Bent sideways by more than linear elements can take, then cut on the side that is stretched.
  const std::string bent = R"({"do": "grasp", "tool": "forceps", "at": {"position": [40, 10, 10]}},
    {"do": "retract", "tool": "forceps", "path": [{"at_s": 1, "position": [36, 10, -4],
                                                  "rotation": {"axis": [0, 1, 0], "degrees": 40}}]})";
  const Plan plan =
      plan_of(("[" + bent + "," + drawn_cut("9") + R"(,{"do": "hold", "duration_s": 0.5}])").c_str(), true);
  PlanRun run(plan);
  double before_m = 0;
  while (run.next()) {
    if (run.frame().step == 1) before_m = opening_m(run);
  }
  EXPECT_GT(run.figures()[2].tetrahedra_removed, 20U);
  EXPECT_GT(opening_m(run), before_m + 5e-4) << "it opens as soon as it is cut";
  EXPECT_EQ(run.frame().tools[kForcepsTool].nodes, 25U) << "what is held stays held";
  const Eigen::Index end = 3 * (8 + 9 * 2 + 45 * 2);
  EXPECT_LT((run.frame().displacement_m.segment<3>(end) - Vector3(-0.004, 0, -0.014)).norm(), 1e-9);
  // The balance does not depend on what was cut when: cut first and bent then, it lies the same way.
  const Plan first = plan_of(("[" + drawn_cut("9") + "," + bent + "]").c_str(), true);
  PlanRun cut(first);
  while (cut.next()) {
  }
  EXPECT_EQ(run.mesh().nodes, cut.mesh().nodes);
  EXPECT_LT((run.frame().displacement_m - cut.frame().displacement_m).lpNorm<Eigen::Infinity>(), 1e-7);
}

TEST_F(PlanRunTest, SaysWhereItCouldNotGoOn) {
  EXPECT_THAT(failure(plan_of(R"([{"do": "hold", "duration_s": 0.5},
      {"do": "press", "tool": "thumb", "path": [{"at_s": 0, "position": [30, 10, 40]}, {"at_s": 1, "position": [30, 10, 29]}]}])")),
              "steps[1] (press): 'thumb' never touches the tissue: the nearest it comes is 4 mm");
  EXPECT_THAT(failure(plan_of(R"([{"do": "grasp", "tool": "forceps", "at": {"position": [60, 10, 10]}}])")),
              HasSubstr("steps[0] (grasp): "));
  EXPECT_THAT(
      failure(plan_of(
          R"([{"do": "cut", "tool": "knife", "path": [{"at_s": 0, "position": [60, 0, 0]}, {"at_s": 1, "position": [70, 0, 0]}]}])")),
      "steps[0] (cut): 'knife' never meets the tissue: look at its path and its edge");
}

/// All steps that a turning body has.
constexpr const char* kTurningSteps = R"([
    {"do": "grasp", "tool": "forceps", "at": {"position": [40, 10, 10]}},
    {"do": "retract", "tool": "forceps", "path": [{"at_s": 1, "position": [25.5, 10, 35.5],
      "rotation": {"axis": [0, -1, 0], "degrees": 90}}]},
    {"do": "press", "tool": "thumb", "path": [{"at_s": 0, "position": [10, 10, 28]}, {"at_s": 1, "position": [10, 10, 19]}]},
    {"do": "hold", "duration_s": 0.5}, {"do": "release", "tool": "forceps"}, {"do": "release", "tool": "thumb"}])";

double moved_volume_m3(TetMesh mesh, const Eigen::VectorXd& displacement_m) {
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node)
    mesh.nodes[node] += displacement_m.segment<3>(static_cast<Eigen::Index>(3 * node));
  double sum = 0;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) sum += signed_volume_m3(mesh, t);
  return sum;
}

TEST_F(PlanRunTest, ACorotationalOrganKeepsItsVolume) {
  for (const bool corotational : {false, true}) {
    const Plan plan = plan_of(kTurningSteps, corotational);
    PlanRun run(plan);
    double largest_change = 0;
    while (run.next()) {
      if (run.frame().step > 1) break;
      largest_change =
          std::max(largest_change, std::abs(moved_volume_m3(run.mesh(), run.frame().displacement_m) /
                                                moved_volume_m3(run.mesh(), 0 * run.frame().displacement_m) -
                                            1));
    }
    if (!corotational) {
      EXPECT_GT(largest_change, 0.15);
      continue;
    }
    EXPECT_LT(largest_change, 0.05);
    while (run.next()) {
      if (run.frame().step != 3) continue;
      EXPECT_GT(run.frame().tools[kThumbTool].nodes, 0U);
    }
    EXPECT_LT(run.frame().displacement_m.norm(), 1e-8);  // all let go
    EXPECT_THAT(run.figures(), SizeIs(6));
  }
}

TEST_F(PlanRunTest, ACorotationalOrganIsRestoredToTheBit) {
  const Plan plan = plan_of(kTurningSteps, true);
  PlanRun run(plan);
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(run.next());
  PlanRun kept(run);
  while (run.next()) {
    ASSERT_TRUE(kept.next());
    EXPECT_EQ(kept.frame().displacement_m, run.frame().displacement_m);
    EXPECT_EQ(kept.frame().tools[kForcepsTool].force_n, run.frame().tools[kForcepsTool].force_n);
  }
}

class PlanBytesTest : public PlanRunTest, public testing::WithParamInterface<bool> {};

TEST_P(PlanBytesTest, AreTheSameTwice) {
  const Plan plan = plan_of(R"([{"do": "press", "tool": "thumb",
      "path": [{"at_s": 0, "position": [30, 10, 26]}, {"at_s": 0.5, "position": [30, 10, 24]}]}])",
                            GetParam());
  const auto all = [&] {
    PlanRun run(plan);
    PlanTables tables(plan);
    std::string text;
    while (run.next()) {
      tables.add(run);
      text += frame_vtu(plan, run);
    }
    return text + tables.forces() + tables.stress() + tables.tools() + steps_json(plan, run);
  };
  const std::string once = all();
  EXPECT_EQ(once, all());
  EXPECT_THAT(once, HasSubstr("\r\n0.25,steps[0],thumb,"));
  EXPECT_THAT(once, HasSubstr("\r\n0,before,0,0,"));
}

INSTANTIATE_TEST_SUITE_P(LinearAndTurning, PlanBytesTest, testing::Bool());

TEST_F(PlanRunTest, IsKeptForGoingBackAndForth) {
  const Plan plan = plan_of(R"([
      {"do": "grasp", "tool": "forceps", "at": {"position": [40, 10, 10]}},
      {"do": "retract", "tool": "forceps", "name": "Show the bed", "path": [{"at_s": 1, "position": [44, 10, 10]}]},
      {"do": "release", "tool": "forceps"},
      {"do": "cut", "tool": "knife", "path": [{"at_s": 0, "position": [20, 10, -5]}, {"at_s": 1, "position": [20, 25, -5]}]}])");
  EXPECT_EQ(title_of(plan, plan.steps[0]), "grasp forceps");
  EXPECT_EQ(title_of(plan, plan.steps[1]), "Show the bed");
  EXPECT_EQ(title_of(plan, plan.steps[2]), "release forceps");
  EXPECT_EQ(begins_s(plan, 3), 1);
  EXPECT_EQ(begins_s(plan, 4), 2);
  double told_s = 0;
  const PlanFrames frames(plan, [&](double time_s) { told_s = time_s; });
  EXPECT_EQ(told_s, 2);
  PlanRun run(plan);
  std::size_t number = 0;
  for (; run.next(); ++number) {
    ASSERT_LT(number, frames.all().size());
    const PlanFrames::Kept& kept = frames.all()[number];
    EXPECT_EQ(kept.frame.displacement_m, run.frame().displacement_m);
    EXPECT_EQ(kept.mesh->tetrahedra.size(), run.mesh().tetrahedra.size());
  }
  EXPECT_EQ(number, frames.all().size());
  EXPECT_EQ(frames.all()[0].mesh, frames.all()[1].mesh);
  EXPECT_LT(frames.all().back().mesh->tetrahedra.size(), frames.all()[0].mesh->tetrahedra.size());
  // Before and after a step that takes no time are moments of their own.
  EXPECT_EQ(frames.at(1, 1).frame.step, 1U);
  EXPECT_TRUE(frames.at(1, 1).frame.poses[kForcepsTool].has_value());
  EXPECT_FALSE(frames.at(2, 1).frame.poses[kForcepsTool].has_value());
  EXPECT_EQ(frames.at(1, 0.6).frame.time_s, 0.5);
  EXPECT_EQ(frames.at(0, 0).frame.step, 0U);
  EXPECT_EQ(&frames.at(3, 99), &frames.all().back());
}

}  // namespace
}  // namespace kiroku::sim
