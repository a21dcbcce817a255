#include "trainer/exclusion/patient_organ.h"

#include <array>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/flat_organ_volume.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"
#include "trainer/exclusion/exclusion_run.h"
#include "trainer/exclusion/simulated_trainee.h"
#include "trainer/exclusion/task_trial.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;
using testing::HasSubstr;

class PatientOrganTest : public testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path document(const std::string& more) const {
    return test::write_flat_organ_document(folder.path(), more);
  }
  [[nodiscard]] std::string refusal(const std::string& more) const {
    try {
      (void)read_patient_organ(document(more));
    } catch (const Error& error) {
      return error.what();
    }
    return "not refused";
  }

  test::TemporaryFolder folder;
};

TEST_F(PatientOrganTest, OfACtIsHeldAtItsFarEndAndHidesALineByTheRule) {
  const PatientOrgan organ = read_patient_organ(document(""));
  EXPECT_EQ(organ.object.name, "left lobe");
  const sim::TetMesh& mesh = organ.object.mesh;
  EXPECT_NEAR(static_cast<double>(mesh.nodes.size()), 1500, 225);
  const sim::Extent extent = sim::extent_of(mesh);
  const double held_from_m = extent.greatest.z() - 0.25 * (extent.greatest.z() - extent.least.z());
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node)
    EXPECT_EQ(organ.object.constraints.prescribed(3 * node), mesh.nodes[node].z() >= held_from_m) << node;
  const ExclusionTask& task = organ.task;
  // Across the view, behind the organ, hidden; the eye before and below it.
  EXPECT_NEAR((task.line_to_m - task.line_from_m).x(), 0.22 * (extent.greatest.x() - extent.least.x()), 5e-3);
  EXPECT_GT(task.line_from_m.y(), extent.greatest.y());
  EXPECT_LT(task.eye_m.z(), extent.least.z());
  EXPECT_LT(task.eye_m.y(), extent.least.y());
  EXPECT_EQ(geometric_visible_share(mesh, {}, task), 0);
  EXPECT_EQ(task.damage_pa, 100e3);
}

constexpr double kForceRateHz = 500;

/// The task, coarse, by a trainee who is shown no stress.
ExclusionOutcome tried(const ExclusionBody& body, SimulatedTrainee& trainee,
                       double most_s = ExclusionOptions().most_s) {
  ExclusionOptions options;
  options.force_rate_hz = kForceRateHz;
  options.picture_rate_hz = 10;
  options.width = 320;
  options.height = 240;
  options.most_s = most_s;
  ExclusionRunner runner(body, options);
  return runner.run_in_own_time(trainee, [&](const ExclusionView& view) {
    trainee.see(view, false);
    return true;
  });
}

TEST_F(PatientOrganTest, OfACtIsPushedAsideByASimulatedTrainee) {
  PatientOrgan organ = read_patient_organ(document(R"(, "exclusion": {"damage_pa": 8000})"));
  EXPECT_EQ(organ.task.damage_pa, 8000);
  const ExclusionBody body(std::move(organ.object), organ.task);
  SimulatedTrainee trainee(body, unpractised_plan(3, 1), 1 / kForceRateHz);
  const ExclusionOutcome outcome = tried(body, trainee);
  EXPECT_TRUE(outcome.score.done) << outcome.score.best_visible_share;
  EXPECT_GT(outcome.score.peak_force_n, 0.05);
  EXPECT_GT(measured_force_rate_hz(body, 3), 0);
  EXPECT_NO_THROW(require_haptic_rate(body, 3, 1000));
  try {
    require_haptic_rate(body, 3, 412.3);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("the mesh of left lobe is too large to be felt on this machine: with 3 "
                          "fingers forces came at 412 Hz, and a hand needs 1000"));
  }
}

TEST_F(PatientOrganTest, ThatASimulatedTraineeCannotPushAsideIsDoubted) {
  PatientOrgan organ = read_patient_organ(document(""));
  constexpr std::array<std::size_t, 2> kFingers{5, 3};
  EXPECT_EQ(doubt_about(ExclusionBody(organ.object, organ.task), kFingers), "");
  for (auto& [region, material] : organ.object.materials) material.young_modulus_pa = 1e9;  // as bone
  EXPECT_THAT(doubt_about(ExclusionBody(organ.object, organ.task), kFingers),
              testing::AllOf(HasSubstr("perhaps nobody can bring the line behind left lobe into sight"),
                             HasSubstr("tried with 5 and 3 fingers and saw 0 % of it at best"),
                             HasSubstr("more than 40 N, where 90 %")));
}

TEST_F(PatientOrganTest, TooStiffForASimulatedTraineeIsTriedElsewhereAndGivenUp) {
  PatientOrgan organ = read_patient_organ(document(""));
  for (auto& [region, material] : organ.object.materials) material.young_modulus_pa = 1e9;
  const ExclusionBody body(std::move(organ.object), organ.task);
  SimulatedTrainee trainee(body, unpractised_plan(3, 1), 1 / kForceRateHz);
  const ExclusionOutcome outcome = tried(body, trainee, 20);
  EXPECT_FALSE(outcome.score.done);
  EXPECT_GT(trainee.places_tried(), 2);
  EXPECT_EQ(outcome.faults.jumps, 0U);
}

TEST_F(PatientOrganTest, ATaskThatIsImpossibleIsRefusedInWords) {
  EXPECT_THAT(refusal(R"(, "exclusion": {"line": [[-20, -260, 120], [20, -260, 120]]})"),
              HasSubstr("behind left lobe, the line can be seen already, 100 % of it"));
  // Behind the part that is held, as seen from the feet.
  EXPECT_THAT(refusal(R"(, "exclusion": {"line": [[-20, -170, 230], [20, -170, 230]]})"),
              HasSubstr("is out of reach: with all that is not held lifted by up to 6 cm"));
  EXPECT_THAT(refusal(R"(, "exclusion": {"line": [[-200, -170, 150], [200, -170, 150]]})"),
              HasSubstr("is outside the picture"));
  EXPECT_THAT(refusal(R"(, "exclusion": {"line": [[0, -170, 150], [0, -170, 151]]})"),
              HasSubstr("shorter than it is thick"));
  EXPECT_THAT(refusal(R"(, "exclusion": {"eye": [0, -600, 160]})"), HasSubstr("can be"));
  EXPECT_THAT(refusal(R"(, "exclusion": {"lifts": [0, -1, 0]})"), HasSubstr("give both, or none"));
  EXPECT_THAT(refusal(R"(, "exclusion": {"lifts": [0, -1, 0], "away": [0, 1, 0]})"),
              HasSubstr("exclusion.away is the way the organ is lifted"));
  for (const std::string name : {"a", "b", "c"})
    EXPECT_THAT(refusal(R"(, "name": ")" + name + R"(")"), HasSubstr("not a, b or c")) << name;
  EXPECT_THAT(refusal(R"(, "loads": [])"), HasSubstr("loads"));
  EXPECT_THAT(
      refusal(R"(, "fixed": [{"box": [[-100, -300, 200], [100, 0, 300]], "displacement": [1, 0, 0]}])"),
      HasSubstr("is held where it is"));
}

TEST_F(PatientOrganTest, OfARealCtHidesALine) {
  KIROKU_NEEDS_SHARED_DATA("sim/abdomen/example_seg.nii.gz");
  std::filesystem::create_symlink(test::shared_data("sim/abdomen/example_ct.nii.gz"), folder / "ct.nii.gz");
  std::filesystem::create_symlink(test::shared_data("sim/abdomen/example_seg.nii.gz"), folder / "seg.nii.gz");
  const std::filesystem::path file = folder / "liver.json";
  std::ofstream(file) << R"({"mesh": {"labels": "seg.nii.gz", "organ": "liver", "vertices": 2000},
      "volume": "ct.nii.gz", "length_unit": "mm",
      "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.45}]})";
  const PatientOrgan organ = read_patient_organ(file);
  EXPECT_EQ(organ.object.name, "liver");
  EXPECT_LE(geometric_visible_share(organ.object.mesh, {}, organ.task), 0.02);
}

}  // namespace
}  // namespace kiroku::trainer
