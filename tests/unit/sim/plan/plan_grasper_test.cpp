// Two jaws that close on a block, hold it by friction, and lose it when it is pulled too hard.
#include <cmath>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "sim/mesh/mesh_writer.h"
#include "sim/plan/plan_document.h"
#include "sim/plan/plan_report.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kFriction = 0.5;

struct GrasperFrame {
  PlanFrame frame;
  double largest_off_face_m = 0;  // of a pressed node, from the face of its jaw
};
struct GrasperRun {
  std::vector<GrasperFrame> frames;
  std::vector<StepFigures> figures;
  std::string forces, steps;
};

/// tet_grid() is not symmetric: this is its lower half and the mirror image of that.
TetMesh mirrored_block() {
  const TetMesh half = test::tet_grid({8, 4, 2}, {0.04, 0.02, 0.01});
  TetMesh whole = half;
  std::vector<std::uint32_t> image(half.nodes.size());
  for (std::uint32_t node = 0; node < half.nodes.size(); ++node) {
    image[node] = node;
    if (half.nodes[node].z() > 0.01 - 1e-9) continue;  // on the mirror
    image[node] = static_cast<std::uint32_t>(whole.nodes.size());
    const Vector3& place = half.nodes[node];
    whole.nodes.emplace_back(place.x(), place.y(), 0.02 - place.z());
  }
  for (const Tetrahedron& corners : half.tetrahedra)
    whole.tetrahedra.push_back({image[corners[1]], image[corners[0]], image[corners[2]], image[corners[3]]});
  whole.regions.resize(whole.tetrahedra.size());
  return whole;
}

/// A block of 40 x 20 x 20 mm held at x = 0; the jaws close along z on its free end, 10 mm of which they
/// take.
class PlanGrasperTest : public testing::TestWithParam<bool> {
 protected:
  PlanGrasperTest() {
    std::ofstream(folder_ / "block.msh")
        << msh_text(test::tet_grid({8, 4, 4}, {0.04, 0.02, 0.02}), LengthUnit::kMillimetre);
    std::ofstream(folder_ / "mirrored.msh") << msh_text(mirrored_block(), LengthUnit::kMillimetre);
    document_ = ordered_json::parse(R"({
      "name": "Pinch", "mesh": "block.msh", "length_unit": "mm", "time_step_s": 0.1,
      "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.3}],
      "fixed": [{"box": [[0, 0, 0], [0, 20, 20]]}],
      "tools": {"grasper": {"kind": "grasper", "jaw": [12, 30, 4], "opening": 22, "friction": 0.5}},
      "steps": [{"do": "close", "tool": "grasper", "at": {"position": [37, 10, 10]}, "opening": 18, "duration_s": 0.5},
                {"do": "hold", "duration_s": 0.2}]})");
  }
  void pull(double to_x_mm, double duration_s) {
    document_["steps"].push_back({{"do", "retract"},
                                  {"tool", "grasper"},
                                  {"path", {{{"at_s", duration_s}, {"position", {to_x_mm, 10, 10}}}}}});
  }
  [[nodiscard]] std::vector<std::string> errors() const {
    std::vector<std::string> errors = read_plan_text(document_.dump(), folder_ / "plan.json").errors;
    const std::string before = "cannot use " + (folder_ / "plan.json").string() + ": ";
    for (std::string& error : errors) {
      if (error.starts_with(before)) error.erase(0, before.size());
    }
    return errors;
  }
  [[nodiscard]] Plan plan(bool corotational) const {
    ordered_json document = document_;
    document["corotational"] = corotational;
    PlanReading reading = read_plan_text(document.dump(), folder_ / "plan.json");
    EXPECT_THAT(reading.errors, IsEmpty());
    return *reading.plan;
  }
  [[nodiscard]] static GrasperRun run(const Plan& plan) {
    PlanRun run(plan);
    PlanTables tables(plan);
    GrasperRun all;
    while (run.next()) {
      tables.add(run);
      GrasperFrame& one = all.frames.emplace_back(GrasperFrame{run.frame(), 0});
      if (!one.frame.poses[0]) continue;
      const double half_m = one.frame.grips[0].opening_m / 2;
      for (std::size_t node = 0; node < run.mesh().nodes.size(); ++node) {
        const auto at = static_cast<Eigen::Index>(3 * node);
        if (one.frame.tool_force_n.segment<3>(at).isZero(0)) continue;
        const Vector3 in_tool_m =
            one.frame.poses[0]->to_tool(run.mesh().nodes[node] + one.frame.displacement_m.segment<3>(at));
        one.largest_off_face_m = std::max(one.largest_off_face_m, std::abs(std::abs(in_tool_m.z()) - half_m));
      }
    }
    all.figures = run.figures();
    all.forces = tables.forces();
    all.steps = steps_json(plan, run, {});
    return all;
  }
  static std::string failure(const Plan& plan) {
    try {
      (void)run(plan);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  test::TemporaryFolder folder_;
  ordered_json document_;
};

TEST_P(PlanGrasperTest, NodesAreDisplacedOntoTheFacesOfTheJawsAndForcesAreSymmetric) {
  document_["mesh"] = "mirrored.msh";
  const GrasperRun all = run(plan(GetParam()));
  const PlanFrame& closed = all.frames.back().frame;
  const PlanGrip& grip = closed.grips[0];
  EXPECT_EQ(grip.opening_m, 0.018);
  EXPECT_GE(grip.grip.jaws[0].nodes, 10U);
  EXPECT_EQ(grip.grip.jaws[0].nodes, grip.grip.jaws[1].nodes);
  EXPECT_LT(all.frames.back().largest_off_face_m, 1e-6);
  // Both jaws feel the same, each away from the tissue.
  const double squeeze_n = grip.grip.squeeze_n;
  EXPECT_NEAR(squeeze_n, 5000 * 0.1 * 0.01 * 0.02, 0.05) << "a tenth shorter, over the pinched area";
  EXPECT_NEAR(grip.grip.jaws[0].force_n.z(), squeeze_n, 2e-3 * squeeze_n);
  EXPECT_NEAR(grip.grip.jaws[1].force_n.z(), -squeeze_n, 2e-3 * squeeze_n);
  EXPECT_NEAR(grip.grip.jaws[0].normal_n, grip.grip.jaws[1].normal_n, 2e-3 * squeeze_n);
  // What the tool feels is the sum over both, and the opposite of what acts on the tissue.
  const Vector3 sum_n = grip.grip.jaws[0].force_n + grip.grip.jaws[1].force_n;
  Vector3 on_tissue_n = Vector3::Zero();
  for (Eigen::Index at = 0; at < closed.tool_force_n.size(); at += 3)
    on_tissue_n += closed.tool_force_n.segment<3>(at);
  EXPECT_LT((closed.tools[0].force_n - sum_n).norm(), 1e-12);
  EXPECT_LT((closed.tools[0].force_n + on_tissue_n).norm(), 1e-6 * squeeze_n);
  EXPECT_EQ(closed.tools[0].nodes, grip.grip.jaws[0].nodes + grip.grip.jaws[1].nodes);
  EXPECT_THAT(all.figures[0].remarks, IsEmpty());
  EXPECT_THAT(all.figures[1].remarks, IsEmpty());
}

TEST_P(PlanGrasperTest, HoldsBelowTwiceFrictionTimesTheSqueezeAndSlipsThere) {
  pull(37.8, 0.8);
  pull(42, 4.2);
  const GrasperRun all = run(plan(GetParam()));
  double held_slip_m = 0, first_pull_n = 0;
  bool slips = false;
  for (const GrasperFrame& one : all.frames) {
    if (one.frame.step < 2 || !one.frame.poses[0]) continue;
    const PlanGrip& grip = one.frame.grips[0];
    // The limit that Coulomb has for two jaws, with what each presses with now.
    const double most_n = kFriction * (grip.grip.jaws[0].force_n.z() - grip.grip.jaws[1].force_n.z());
    EXPECT_LE(grip.grip.pull_n, 1.01 * most_n);
    EXPECT_NEAR(grip.grip.most_pull_n, 2 * kFriction * grip.grip.squeeze_n, 1e-12);
    if (one.frame.step == 2) {
      EXPECT_LT(grip.grip.pull_n, 0.9 * most_n);
      held_slip_m = grip.slipped_m;
      first_pull_n = grip.grip.pull_n;
    }
    slips = slips || grip.grip.pull_n > 0.985 * most_n;
  }
  EXPECT_THAT(all.figures[2].remarks, IsEmpty()) << "held";
  EXPECT_GT(first_pull_n, 0.01);
  EXPECT_LT(held_slip_m, 2e-4) << "of 0.8 mm";
  EXPECT_TRUE(slips);
  EXPECT_THAT(all.figures[3].remarks,
              ElementsAre(testing::AllOf(HasSubstr("the tissue slips in 'grasper', by "),
                                         HasSubstr(" N each hold "))));
  EXPECT_GT(all.figures[3].slipped_m[0], 1e-3);
  const PlanGrip& last = all.frames.back().frame.grips[0];
  EXPECT_NEAR(last.grip.pull_n, 2 * kFriction * last.grip.squeeze_n, 0.015 * last.grip.pull_n);
  const json steps = json::parse(all.steps)["steps"];
  EXPECT_NEAR(steps[3]["tools"]["grasper"]["slipped"].get<double>(), 1000 * all.figures[3].slipped_m[0],
              1e-9);
  EXPECT_GT(steps[3]["tools"]["grasper"]["largest_squeeze_n"].get<double>(), 0.05);
  EXPECT_THAT(all.forces, HasSubstr(",grasper jaw 1,"));
  EXPECT_THAT(all.forces, HasSubstr(",grasper jaw 2,"));
}

TEST_P(PlanGrasperTest, ABackThatPushesTheTissueSqueezesNothing) {
  pull(60, 1);
  document_["steps"].push_back({{"do", "retract"},
                                {"tool", "grasper"},
                                {"path",
                                 {{{"at_s", 1}, {"position", {60, 10, 60}}},
                                  {{"at_s", 2}, {"position", {30, 10, 60}}},
                                  {{"at_s", 3}, {"position", {30, 10, 34}}},
                                  {{"at_s", 4}, {"position", {30, 10, 32}}}}}});
  const GrasperRun all = run(plan(GetParam()));
  EXPECT_THAT(all.figures[2].remarks, Contains(HasSubstr("the tissue has slipped out of 'grasper'")));
  // The back of the lower jaw has come down on the block by a millimetre.
  const PlanFrame& end = all.frames.back().frame;
  const Grip& grip = end.grips[0].grip;
  EXPECT_GT(grip.jaws[1].nodes, 0U);
  EXPECT_GT(grip.jaws[1].force_n.z(), 0.01);
  EXPECT_GT(end.tools[0].force_n.z(), 0.01) << "what the hand feels stays";
  EXPECT_EQ(grip.squeeze_n, 0);
  EXPECT_EQ(grip.pull_n, 0);
  EXPECT_EQ(grip.most_pull_n, 0);
  EXPECT_EQ(all.figures[3].largest_squeeze_n[0], 0);
  EXPECT_THAT(all.figures[3].remarks, IsEmpty()) << "nothing was held that could slip out";
}

TEST_P(PlanGrasperTest, TissueThatIsPulledOnSlipsOutAndIsBackAtRest) {
  pull(60, 6);
  document_["steps"].push_back({{"do", "release"}, {"tool", "grasper"}});
  const GrasperRun all = run(plan(GetParam()));
  ASSERT_EQ(all.figures[2].remarks.size(), 2U);
  EXPECT_THAT(all.figures[2].remarks[1], HasSubstr("the tissue has slipped out of 'grasper'"));
  const PlanFrame& end = all.frames.back().frame;
  EXPECT_FALSE(end.poses[0]);
  EXPECT_LT(end.displacement_m.lpNorm<Eigen::Infinity>(), 1e-8);
}

TEST_P(PlanGrasperTest, OpensAgainAndClosesTighter) {
  document_["steps"].push_back({{"do", "close"}, {"tool", "grasper"}, {"opening", 16}, {"duration_s", 0.3}});
  document_["steps"].push_back({{"do", "close"}, {"tool", "grasper"}, {"opening", 22}, {"duration_s", 0.5}});
  const GrasperRun all = run(plan(GetParam()));
  EXPECT_NEAR(all.figures[2].largest_squeeze_n[0] / all.figures[0].largest_squeeze_n[0], 2, 0.2);
  EXPECT_EQ(all.frames.back().frame.grips[0].grip.squeeze_n, 0);
  EXPECT_EQ(all.frames.back().frame.tools[0].nodes, 0U);
  EXPECT_LT(all.frames.back().frame.displacement_m.lpNorm<Eigen::Infinity>(), 1e-8);
}

INSTANTIATE_TEST_SUITE_P(LinearAndTurning, PlanGrasperTest, testing::Bool());

class PlanGrasperWordsTest : public PlanGrasperTest {};

TEST_F(PlanGrasperWordsTest, SaysWhatCannotBe) {
  const ordered_json sound = document_;
  const auto with = [&](const char* pointer, const ordered_json& value) {
    document_ = sound;
    document_[ordered_json::json_pointer(pointer)] = value;
    return errors();
  };
  EXPECT_THAT(with("/steps/0/opening", 23),
              ElementsAre("steps[0].opening is 23: 'grasper' opens to 22 at most"));
  EXPECT_THAT(with("/steps/1", {{"do", "close"}, {"tool", "grasper"}, {"opening", 12}, {"duration_s", 0.1}}),
              ElementsAre(HasSubstr("steps[1] moves each jaw by 3 in a time step")));
  EXPECT_THAT(with("/steps/1", {{"do", "close"},
                                {"tool", "grasper"},
                                {"at", {{"position", {1, 2, 3}}}},
                                {"opening", 12},
                                {"duration_s", 1}}),
              ElementsAre(HasSubstr("steps[1].at places 'grasper', which is at the organ since steps[0]")));
  EXPECT_THAT(with("/steps/1", {{"do", "grasp"}, {"tool", "grasper"}, {"at", {{"position", {1, 2, 3}}}}}),
              ElementsAre(HasSubstr("steps[1].tool is 'grasper', a grasper: only forceps and pins grasp")));
  EXPECT_THAT(with("/tools/grasper/friction", 0),
              ElementsAre("tools.grasper.friction is 0: it must be between 0.01 and 10"));
  EXPECT_THAT(with("/tools/grasper jaw 2", {{"kind", "finger"}, {"radius", 8}}),
              testing::Contains(HasSubstr("'grasper jaw 2' is what a jaw of 'grasper' is called")));
  document_ = sound;
  document_["steps"][0] = {
      {"do", "retract"},
      {"tool", "grasper"},
      {"path", {{{"at_s", 0}, {"position", {1, 2, 3}}}, {{"at_s", 1}, {"position", {1, 2, 4}}}}}};
  EXPECT_THAT(errors(), ElementsAre("steps[0] moves 'grasper', a grasper that holds nothing: close first"));
}

TEST_F(PlanGrasperWordsTest, SaysWhatCannotBeDone) {
  document_["steps"][0]["at"]["position"] = {37, 10, 14};
  EXPECT_THAT(failure(plan(false)),
              testing::AllOf(HasSubstr("steps[0] (close): 'grasper', open by 22 mm, comes with a jaw in the "
                                       "tissue: node "),
                             HasSubstr(" lies 1 mm deep in it")))
      << "its jaw is 4 mm thick, and reaches 1 mm below";
  document_["steps"][0]["at"]["position"] = {77, 10, 10};
  EXPECT_THAT(failure(plan(false)),
              HasSubstr("steps[0] (close): 'grasper' never touches the tissue: the nearest it comes is 31"));
}

TEST_F(PlanGrasperWordsTest, APlanMadeByHandHasItsJaws) {
  document_["steps"] = ordered_json::array({{{"do", "hold"}, {"duration_s", 0.1}}});
  PlanReading reading = read_plan_text(document_.dump(), folder_ / "plan.json");
  const ordered_json tooled = with_tools(document_, *reading.plan);
  EXPECT_EQ(tooled["tools"]["grasper 2"]["kind"], "grasper");
  PlanSession session(*read_plan_text(tooled.dump(), folder_ / "plan.json").plan);
  const auto number = static_cast<std::size_t>(
      std::ranges::find(session.plan().tools, "grasper", [](const PlanTool& one) { return one.tool.name; }) -
      session.plan().tools.begin());
  Pose pose;
  pose.position_m = {0.037, 0.0100000001, 0.01};
  session.close({number, pose}, 0.0181234567891);
  session.close({number, {}}, 0.017);
  session.begin_motion({{number, {}}});
  for (int i = 1; i <= 4; ++i) {
    pose.position_m.x() += 2e-4;
    session.advance(std::vector{pose});
  }
  EXPECT_THAT(session.end_motion(), IsEmpty());
  EXPECT_GT(session.frame().tools[number].normal_n, 0.01);
  EXPECT_THROW(session.close({number, {}}, 0.017), Error);
  EXPECT_THROW(session.close({number, {}}, 0.030), Error);
  const ordered_json saved = document_of(document_, tooled, session, "By hand");
  const Plan again = *read_plan_text(saved.dump(), folder_ / "plan.json").plan;
  PlanRun run(again);
  while (run.next()) {
  }
  EXPECT_EQ((run.frame().displacement_m - session.frame().displacement_m).lpNorm<Eigen::Infinity>(), 0);
  EXPECT_EQ(run.frame().grips[0].opening_m, session.frame().grips[number].opening_m);
  session.undo();
  session.undo();
  EXPECT_NEAR(session.frame().grips[number].opening_m, 0.018123457, 1e-12);
  session.release(number);
  EXPECT_EQ(session.frame().grips[number].grip.squeeze_n, 0);
}

}  // namespace
}  // namespace kiroku::sim
