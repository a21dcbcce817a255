#include "sim/plan/plan.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "sim/mesh/mesh_writer.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

TEST(ToolPath, MovesEvenlyAndTurnsTheShorterWay) {
  const Eigen::Quaterniond quarter(Eigen::AngleAxisd(1.5, Vector3::UnitZ()));
  const ToolPath path({{0, {Vector3(0, 0, 0), Eigen::Quaterniond::Identity()}},
                       {2, {Vector3(0.01, 0, 0), quarter}},
                       {3, {Vector3(0.01, 0.02, 0), quarter}}});
  EXPECT_EQ(path.duration_s(), 3);
  EXPECT_EQ(path.at(-1).position_m, Vector3(0, 0, 0));
  EXPECT_EQ(path.at(0.5).position_m, Vector3(0.0025, 0, 0));
  EXPECT_NEAR(path.at(0.5).orientation.angularDistance(Eigen::Quaterniond::Identity()), 0.375, 1e-12);
  EXPECT_EQ(path.at(2).position_m, Vector3(0.01, 0, 0));
  EXPECT_EQ(path.at(2.5).position_m, Vector3(0.01, 0.01, 0));
  EXPECT_EQ(path.at(7).position_m, Vector3(0.01, 0.02, 0));
  const Eigen::Quaterniond other_sign(-quarter.coeffs());
  const ToolPath same({{0, {Vector3::Zero(), quarter}}, {1, {Vector3::Zero(), other_sign}}});
  EXPECT_LT(same.at(0.5).orientation.angularDistance(quarter), 1e-7);
}

/// A block of 40 x 20 x 20 mm.
class PlanTest : public testing::Test {
 protected:
  PlanTest() {
    std::ofstream(folder_ / "block.msh")
        << msh_text(test::tet_grid({4, 2, 2}, {0.04, 0.02, 0.02}), LengthUnit::kMillimetre);
  }
  [[nodiscard]] PlanReading read(const json& document) const { return read_text(document.dump()); }
  [[nodiscard]] PlanReading read_text(const std::string& text) const {
    std::ofstream(folder_ / "plan.json") << text;
    return read_plan(folder_ / "plan.json");
  }
  /// The errors without the file's name.
  [[nodiscard]] std::vector<std::string> errors(const json& document) const {
    std::vector<std::string> errors = read(document).errors;
    for (std::string& error : errors) {
      const std::string name = "plan.json: ";
      const std::size_t at = error.find(name);
      if (at != std::string::npos) error.erase(0, at + name.size());
    }
    return errors;
  }
  /// Of the plan with one value changed.
  [[nodiscard]] std::vector<std::string> errors_with(const char* pointer, const json& value) const {
    json document = plan_;
    document[json::json_pointer(pointer)] = value;
    return errors(document);
  }

  test::TemporaryFolder folder_;
  json plan_ = json::parse(R"({
    "name": "everything", "mesh": "block.msh", "length_unit": "mm", "time_step_s": 0.1,
    "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.45}],
    "fixed": [{"box": [[0, 0, 0], [0, 20, 20]]}],
    "tools": {"forceps": {"kind": "forceps", "jaws": [10, 22, 22]},
              "pin": {"kind": "pin", "radius": 3},
              "spatula": {"kind": "retractor", "size": [20, 10, 2], "sticks": true},
              "hook": {"kind": "hook", "radius": 2, "length": 20},
              "thumb": {"kind": "finger", "radius": 8}, "index": {"kind": "finger", "radius": 8},
              "knife": {"kind": "scalpel", "edge": 30}},
    "steps": [
      {"do": "grasp", "tool": "forceps", "at": {"position": [40, 10, 10], "rotation": {"axis": [0, 0, 2], "degrees": 90}}},
      {"do": "retract", "tool": "forceps", "path": [{"at_s": 1, "position": [45, 10, 10]}, {"at_s": 1.5, "rotation": {"axis": [1, 0, 0], "degrees": 10}}]},
      {"do": "hold", "duration_s": 0.5},
      {"do": "press", "tools": {"thumb": [{"at_s": 0, "position": [20, 10, 30]}, {"at_s": 1, "position": [20, 10, 27]}],
                                "index": [{"at_s": 0, "position": [20, 10, -10]}, {"at_s": 2, "position": [20, 10, -7]}]}},
      {"do": "cut", "tool": "knife", "path": [{"at_s": 0, "position": [30, -5, 15]}, {"at_s": 1, "position": [30, 10, 15]}]},
      {"do": "release", "tool": "forceps"}, {"do": "release", "tool": "thumb"}]})");
};

TEST_F(PlanTest, ReadsAPlan) {
  const PlanReading reading = read(plan_);
  ASSERT_THAT(reading.errors, IsEmpty());
  const Plan& plan = *reading.plan;
  EXPECT_EQ(plan.name, "everything");
  EXPECT_EQ(plan.time_step_s, 0.1);
  ASSERT_THAT(plan.tools, SizeIs(7));  // by name
  EXPECT_EQ(plan.tools[0].tool.name, "forceps");
  EXPECT_EQ(std::get<Box>(plan.tools[0].tool.shape).half_extent_m, Vector3(0.005, 0.011, 0.011));
  EXPECT_EQ(plan.tools[0].tool.action, ToolAction::kBinds);
  EXPECT_EQ(std::get<Capsule>(plan.tools[1].tool.shape).half_length_m, 0.01);
  EXPECT_EQ(plan.tools[3].edge_m, 0.03);
  EXPECT_EQ(plan.tools[5].tool.action, ToolAction::kSticks);
  EXPECT_EQ(plan.tools[6].tool.action, ToolAction::kGlides);
  ASSERT_THAT(plan.steps, SizeIs(7));
  EXPECT_EQ(plan.steps[0].where, "steps[0]");
  EXPECT_EQ(plan.steps[0].duration_s, 0);
  // It goes on from where the grasp left it, and keeps what a frame does not say.
  const ToolPath& retracted = plan.steps[1].motions.at(0).path;
  EXPECT_EQ(retracted.at(0).position_m, Vector3(0.04, 0.01, 0.01));
  EXPECT_NEAR(retracted.at(1).orientation.angularDistance(
                  Eigen::Quaterniond(Eigen::AngleAxisd(std::acos(0.0), Vector3::UnitZ()))),
              0, 1e-7);
  EXPECT_EQ(retracted.at(1.5).position_m, Vector3(0.045, 0.01, 0.01));
  EXPECT_EQ(plan.steps[3].duration_s, 2);
  EXPECT_THAT(plan.steps[3].motions, SizeIs(2));
  EXPECT_THAT(plan.steps[5].released, ElementsAre(0));
}

TEST_F(PlanTest, WarnsOfToolsThatSlipInBetweenNodes) {
  EXPECT_THAT(read(plan_).plan->body.warnings,
              ElementsAre(HasSubstr("the hook 'hook' is thinner (radius 2) than the mesh is fine"),
                          HasSubstr("the finger 'index'"), HasSubstr("the finger 'thumb'")));
  for (const char* tool : {"index", "thumb", "hook"}) plan_["tools"][tool]["radius"] = 15;
  EXPECT_THAT(read(plan_).plan->body.warnings, IsEmpty());
}

TEST_F(PlanTest, TellsEveryErrorWithItsPath) {
  json document = plan_;
  document["colour"] = "red";
  document["time_step_s"] = 5;
  document["volume"] = "none.nii.gz";
  document["tools"]["pin"]["radius"] = -3;
  document["tools"]["hook"]["kind"] = "rope";
  document["steps"][2]["duration_s"] = "long";
  document["steps"][4]["tool"] = "forceps";
  document["steps"][6]["tool"] = "spoon";
  EXPECT_THAT(
      errors(document),
      ElementsAre(
          "volume is 'none.nii.gz': there is no such file or folder beside the document",
          HasSubstr("the document has the unknown key 'colour'"),
          "time_step_s is 5: it must be between 0.001 and 1",
          "tools.hook.kind is 'rope': it must be one of forceps, pin, grasper, clip, retractor, hook, "
          "finger, scalpel",
          "tools.pin.radius is -3: it must be greater than 0",
          "steps[2].duration_s is of type string where a number is expected",
          "steps[4].tool is 'forceps', a forceps: only a scalpel cuts",
          HasSubstr("steps[6].tool is 'spoon', which 'tools' does not have; it has forceps, ")));
}

TEST_F(PlanTest, AVolumeThatCannotBeLookedAtIsAnErrorWithItsPath) {
  std::filesystem::create_symlink("round", folder_ / "round");
  EXPECT_THAT(errors_with("/volume", "round"),
              ElementsAre(testing::StartsWith("volume is 'round', which cannot be read: ")));
  EXPECT_THROW((void)read_plan(folder_ / "round"), IoError);
}

TEST_F(PlanTest, ReadsWhetherTheOrganTurns) {
  EXPECT_FALSE(read(plan_).plan->corotational);
  EXPECT_THAT(errors_with("/corotational", "yes"),
              ElementsAre("corotational is of type string where true or false is expected"));
  plan_["corotational"] = true;
  const PlanReading reading = read(plan_);
  ASSERT_THAT(reading.errors, IsEmpty());
  EXPECT_TRUE(reading.plan->corotational);
}

TEST_F(PlanTest, RefusesStepsThatCannotFollowEachOther) {
  const auto step = [](const char* text) { return json::parse(text); };
  EXPECT_THAT(
      errors_with("/steps/2", step(R"({"do": "grasp", "tool": "forceps", "at": {"position": [0, 0, 0]}})")),
      ElementsAre("steps[2].tool is 'forceps', which holds since steps[0]: release it first"));
  EXPECT_THAT(
      errors_with("/steps/2", step(R"({"do": "grasp", "tool": "thumb", "at": {"position": [0, 0, 0]}})")),
      ElementsAre("steps[2].tool is 'thumb', a finger: only forceps and pins grasp; others are moved "
                  "by press or retract"));
  EXPECT_THAT(errors_with("/steps/6", step(R"({"do": "release", "tool": "pin"})")),
              ElementsAre("steps[6].tool is 'pin', which is not at the organ"));
  EXPECT_THAT(
      errors_with("/steps/2",
                  step(R"({"do": "retract", "tool": "pin", "path": [{"at_s": 0, "position": [0, 0, 0]},
                                       {"at_s": 1, "position": [1, 0, 0]}]})")),
      ElementsAre("steps[2] moves 'pin', a pin that holds nothing: grasp first"));
  EXPECT_THAT(
      errors_with(
          "/steps/2",
          step(R"({"do": "press", "tool": "forceps", "path": [{"at_s": 1, "position": [1, 0, 0]}]})")),
      ElementsAre("steps[2] moves 'forceps', a forceps: it is moved by retract; press is for tools "
                  "that touch"));
  EXPECT_THAT(
      errors_with("/steps/2",
                  step(R"({"do": "press", "tool": "hook", "path": [{"at_s": 1, "position": [1, 0, 0]}]})")),
      ElementsAre("steps[2].path[0].at_s is 1: the tool is not at the organ yet, so that its first "
                  "pose is at 0"));
  EXPECT_THAT(errors_with("/steps/1/path/1/at_s", 1),
              ElementsAre("steps[1].path[1].at_s is 1, not after the pose before it (1 s)"));
  EXPECT_THAT(errors_with("/steps/1/path", json::array()),
              ElementsAre("steps[1].path goes nowhere: give a pose to move to"));
  EXPECT_THAT(errors_with("/steps/0/at/rotation/axis", {0, 0, 0}),
              testing::Contains("steps[0].at.rotation.axis has no direction"));
  EXPECT_THAT(
      errors_with("/steps/0/do", "dance"),
      testing::Contains("steps[0].do is 'dance': it must be one of grasp, close, retract, press, hold, cut, "
                        "release"));
  EXPECT_THAT(errors_with("/steps", json::array()), ElementsAre("steps has no step"));
}

TEST_F(PlanTest, TellsWhatIsWrongWithTheBody) {
  EXPECT_THAT(errors_with("/materials/0/poisson_ratio", 0.5),
              ElementsAre(HasSubstr("materials[0].poisson_ratio is 0.5")));
  EXPECT_THAT(errors_with("/mesh", "gone.msh"), ElementsAre(HasSubstr("gone.msh")));
  EXPECT_THAT(read_text("{").errors, ElementsAre(HasSubstr("it is no JSON")));
  EXPECT_THAT(read_text("[]").errors, testing::Contains(HasSubstr("the document is of type array")));
  EXPECT_THROW(read_plan(folder_ / "absent.json"), IoError);
}

}  // namespace
}  // namespace kiroku::sim
