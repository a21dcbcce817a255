// A plan for one organ, as a template, on another: of another size, turned and bent.
#include "sim/plan/plan_template.h"

#include <cmath>
#include <fstream>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "sim/mesh/mesh_writer.h"
#include "sim/model/json_field.h"
#include "sim/plan/plan_run.h"
#include "sim/plan/thin_plate_spline.h"
#include "sim/plan/written_pose.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tet_grid.h"

namespace kiroku::sim {
namespace {

using nlohmann::ordered_json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

const Eigen::AngleAxisd kQuarter(std::acos(0.0), Vector3::UnitZ());

/// The other patient's organ: a fifth larger, turned by a quarter about z, elsewhere, and bent upwards.
Vector3 on_other_organ(const Vector3& place_m) {
  Vector3 bent_m = 1.2 * place_m;
  bent_m.z() += 3 * place_m.x() * place_m.x();
  return kQuarter * bent_m + Vector3(0.1, -0.05, 0.02);
}

std::vector<Vector3> mapped(const std::vector<Vector3>& places_m,
                            const std::function<Vector3(const Vector3&)>& by) {
  std::vector<Vector3> out;
  for (const Vector3& place_m : places_m) out.push_back(by(place_m));
  return out;
}

const std::vector<Vector3> kCorners{{0, 0, 0},    {0.04, 0, 0},       {0, 0.02, 0},
                                    {0, 0, 0.02}, {0.04, 0.02, 0.02}, {0.02, 0.01, 0.02}};

template <typename Call>
std::string refused(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

TEST(ThinPlateSpline, GoesThroughItsLandmarksAndIsAffineWhereTheseAre) {
  const ThinPlateSpline bent(kCorners, mapped(kCorners, on_other_organ));
  for (const Vector3& place_m : kCorners)
    EXPECT_LT((bent.at(place_m) - on_other_organ(place_m)).norm(), 1e-12);
  const auto affine = [](const Vector3& place_m) {
    return Vector3(kQuarter * (2 * place_m) + Vector3(1, 2, 3) + 0.3 * place_m.y() * Vector3::UnitX());
  };
  const ThinPlateSpline straight(kCorners, mapped(kCorners, affine));
  const Vector3 far_m(0.3, -0.2, 0.1);
  EXPECT_LT((straight.at(far_m) - affine(far_m)).norm(), 1e-9);
  for (const double residual_m : affine_residuals_m(kCorners, mapped(kCorners, affine)))
    EXPECT_LT(residual_m, 1e-12);
  // Its gradient is that of differences.
  const Vector3 here_m(0.013, 0.007, 0.004);
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Vector3 step_m = 1e-6 * Vector3::Unit(i);
    EXPECT_LT(
        ((bent.at(here_m + step_m) - bent.at(here_m - step_m)) / 2e-6 - bent.gradient(here_m).col(i)).norm(),
        1e-6);
  }
  EXPECT_LT(
      (ThinPlateSpline(kCorners, mapped(kCorners, [](const Vector3& one) { return Vector3(kQuarter * one); }))
           .turn(here_m) -
       kQuarter.toRotationMatrix())
          .norm(),
      1e-9);
}

TEST(ThinPlateSpline, RefusesLandmarksThatTellNoMapping) {
  const std::vector<Vector3> few(kCorners.begin(), kCorners.begin() + 3);
  EXPECT_THAT(refused([&] { ThinPlateSpline(few, few); }), HasSubstr("there are 3 landmarks"));
  std::vector<Vector3> flat = kCorners;
  for (Vector3& place_m : flat) place_m.z() /= 100;
  EXPECT_THAT(refused([&] { ThinPlateSpline(flat, kCorners); }),
              HasSubstr("the landmarks of the template lie in one plane"));
  EXPECT_THAT(refused([&] { ThinPlateSpline(kCorners, flat); }),
              HasSubstr("the landmarks of the patient lie in one plane"));
  std::vector<Vector3> twice = kCorners;
  twice[3] = twice[0];
  EXPECT_THAT(refused([&] { ThinPlateSpline(twice, kCorners); }),
              HasSubstr("two landmarks of the template lie at one place"));
  EXPECT_THAT(refused([&] {
                ThinPlateSpline(kCorners, mapped(kCorners, [](const Vector3& one) {
                                  return Vector3(-one.x(), one.y(), one.z());
                                }));
              }),
              HasSubstr("mirror image"));
  // Two that lie beside each other are exchanged.
  std::vector<Vector3> sound = kCorners, exchanged = kCorners;
  for (const double x_m : {0.018, 0.022}) {
    sound.emplace_back(x_m, 0.01, 0.01);
    exchanged.emplace_back(0.04 - x_m, 0.01, 0.01);
  }
  EXPECT_THAT(refused([&] {
                (void)ThinPlateSpline(sound, exchanged).turn({0.02, 0.01, 0.01});
              }),
              HasSubstr("folds"));
}

class PlanTemplateTest : public testing::Test {
 protected:
  PlanTemplateTest() {
    const TetMesh own = test::tet_grid({8, 4, 4}, {0.04, 0.02, 0.02});
    TetMesh other = test::tet_grid({9, 5, 3}, {0.04, 0.02, 0.02});
    for (Vector3& node : other.nodes) node = on_other_organ(node);
    std::ofstream(folder_ / "own.msh") << msh_text(own, LengthUnit::kMillimetre);
    std::ofstream(folder_ / "other.msh") << msh_text(other, LengthUnit::kMillimetre);
    plan_ = ordered_json::parse(R"({
      "name": "Lift", "mesh": "own.msh", "length_unit": "mm", "time_step_s": 0.1,
      "materials": [{"region": "all", "young_modulus_pa": 5000, "poisson_ratio": 0.4}],
      "fixed": [{"box": [[0, 0, 0], [0, 20, 20]]}],
      "tools": {"forceps": {"kind": "forceps", "jaws": [8, 30, 30]}, "thumb": {"kind": "finger", "radius": 6},
                "knife": {"kind": "scalpel", "edge": 60}},
      "steps": [
        {"do": "grasp", "tool": "forceps", "at": {"position": [39, 10, 10]}},
        {"do": "retract", "tool": "forceps", "path": [{"at_s": 0.5, "position": [40, 10, 13]},
          {"at_s": 1, "rotation": {"axis": [0, 1, 0], "degrees": 10}}]},
        {"do": "press", "tool": "thumb", "path": [{"at_s": 0, "position": [20, 10, 27]}, {"at_s": 0.5, "position": [20, 10, 22]}]},
        {"do": "release", "tool": "thumb"},
        {"do": "cut", "tool": "knife", "curve": {"through": [[10, 4, 20], [10, 16, 20]], "depth": 5, "direction": [0, 0, -1]}}]})");
    patient_ = ordered_json::parse(R"({
      "name": "Another patient", "mesh": "other.msh", "length_unit": "mm",
      "materials": [{"region": "all", "young_modulus_pa": 9000, "poisson_ratio": 0.4}],
      "fixed": [{"box": [[70, -51, 15], [101, -49, 50]]}], "steps": []})");
    for (std::size_t i = 0; i < kCorners.size(); ++i) {
      own_landmarks_["place " + std::to_string(i)] = kCorners[i];
      other_landmarks_["place " + std::to_string(i)] = on_other_organ(kCorners[i]);
    }
  }
  [[nodiscard]] Plan read(const ordered_json& document) const {
    PlanReading reading = read_plan_text(document.dump(), folder_ / "plan.json");
    EXPECT_THAT(reading.errors, IsEmpty()) << document.dump(1);
    return *reading.plan;
  }
  [[nodiscard]] ordered_json made() const { return plan_template(plan_, read(plan_), own_landmarks_); }
  [[nodiscard]] AdaptedPlan adapted(const ordered_json& from) const {
    const nlohmann::json document = nlohmann::json::parse(patient_.dump());
    const BodyModel body = BodyReader(JsonField(document, "patient.json"), folder_.path()).take();
    return adapt_template(from.dump(), "lift.template.json", patient_, body, other_landmarks_);
  }
  static Vector3 place_m(const ordered_json& pose) {
    return Vector3(pose["position"][0], pose["position"][1], pose["position"][2]) / 1000;
  }

  test::TemporaryFolder folder_;
  ordered_json plan_, patient_;
  PlanLandmarks own_landmarks_, other_landmarks_;
};

TEST_F(PlanTemplateTest, SavesToolsStepsAndHowFarTheyAreFromTheOrgan) {
  const ordered_json saved = made();
  EXPECT_EQ(saved["format"], "kiroku-plan-template/1");
  EXPECT_FALSE(saved.contains("mesh"));
  EXPECT_EQ(saved["tools"], plan_["tools"]);
  EXPECT_EQ(saved["landmarks"]["place 1"], ordered_json({40, 0, 0}));
  EXPECT_NEAR(saved["steps"][0]["at"]["from_surface"].get<double>(), -1, 1e-6) << "inside";
  EXPECT_NEAR(saved["steps"][2]["path"][0]["from_surface"].get<double>(), 7, 1e-6);
  EXPECT_FALSE(saved["steps"][2]["path"][1].contains("from_surface"));
}

TEST_F(PlanTemplateTest, ATemplateIsCarriedOutOnAnotherOrgan) {
  const AdaptedPlan other = adapted(made());
  const ordered_json& steps = other.document["steps"];
  EXPECT_EQ(other.document["name"], "Lift");
  EXPECT_EQ(other.document["mesh"], "other.msh");
  EXPECT_EQ(other.document["time_step_s"], 0.1);
  // Where the mapping of the organs has it, but for what the spline does not know of the bend.
  EXPECT_LT((place_m(steps[0]["at"]) - on_other_organ({0.039, 0.01, 0.01})).norm(), 1e-3);
  EXPECT_LT((place_m(steps[1]["path"][0]) - on_other_organ({0.040, 0.01, 0.013})).norm(), 1.5e-3);
  EXPECT_LT(other.furthest_to_surface_m, 3e-3);
  // Turned with the organ.
  const ordered_json& turn = steps[0]["at"]["rotation"];
  const Eigen::Quaterniond is =
      orientation_of({Vector3(turn["axis"][0], turn["axis"][1], turn["axis"][2]), turn["degrees"]});
  EXPECT_LT(is.angularDistance(Eigen::Quaterniond(kQuarter)), 0.3);
  EXPECT_GT(is.angularDistance(Eigen::Quaterniond(kQuarter)), 0.05) << "bent up by some ten degrees";
  // The thumb comes as far from the surface.
  EXPECT_THAT(other.unused, IsEmpty());
  const Plan plan = read(other.document);
  PlanRun run(plan);
  while (run.next()) {
  }
  ASSERT_THAT(run.figures(), SizeIs(5));
  EXPECT_GE(run.figures()[0].most_nodes[0], 10U);
  EXPECT_GT(run.figures()[1].largest_displacement_m, 2.5e-3);
  EXPECT_GT(run.figures()[4].tetrahedra_removed, 0U);
}

TEST_F(PlanTemplateTest, TellsResidualsAndWhatIsNotUsed) {
  other_landmarks_["place 5"] += Vector3(0, 0, 0.004);
  other_landmarks_["hilum"] = Vector3::Zero();
  own_landmarks_["apex"] = Vector3(0.03, 0.02, 0);
  const AdaptedPlan other = adapted(made());
  EXPECT_THAT(other.unused, testing::UnorderedElementsAre("hilum", "apex"));
  ASSERT_THAT(other.fits, SizeIs(6));
  EXPECT_EQ(other.fits[5].name, "place 5");
  EXPECT_GT(other.fits[5].affine_m, 1e-3);
  // It is 4 mm off; the five others take it for a place on the chord of the bend, 1.2 mm above it.
  ASSERT_TRUE(other.fits[5].left_out_m);
  EXPECT_NEAR(*other.fits[5].left_out_m, 0.004 - 3 * (0.04 * 0.02 - 0.02 * 0.02), 1e-4);
  // Of four none can be left out.
  for (const char* const name : {"place 4", "place 5"}) other_landmarks_.erase(name);
  for (const LandmarkFit& fit : adapted(made()).fits) {
    EXPECT_LT(fit.affine_m, 1e-12);
    EXPECT_FALSE(fit.left_out_m);
  }
}

TEST_F(PlanTemplateTest, OnItsOwnOrganItIsThePlanAgain) {
  patient_ = plan_;
  other_landmarks_ = own_landmarks_;
  const AdaptedPlan same = adapted(made());
  EXPECT_LT(same.furthest_to_surface_m, 1e-9);
  const Plan before = read(plan_), after = read(same.document);
  for (std::size_t i = 0; i < before.steps.size(); ++i) {
    ASSERT_EQ(before.steps[i].motions.size(), after.steps[i].motions.size());
    for (std::size_t m = 0; m < before.steps[i].motions.size(); ++m) {
      for (const double time_s : {0.0, 0.25, 0.5, 1.0}) {
        const Pose is = after.steps[i].motions[m].path.at(time_s),
                   was = before.steps[i].motions[m].path.at(time_s);
        EXPECT_LT((is.position_m - was.position_m).norm(), 1e-8);
        EXPECT_LT(is.orientation.angularDistance(was.orientation), 1e-6);
      }
    }
  }
}

TEST_F(PlanTemplateTest, AnAdaptedPlanIsComputedAsTheTemplatesPlanWas) {
  plan_["corotational"] = true;
  const ordered_json turning = made();
  EXPECT_EQ(turning["corotational"], true);
  EXPECT_TRUE(read(adapted(turning).document).corotational);
  EXPECT_THAT(adapted(turning).warnings, IsEmpty());
  plan_["corotational"] = false;
  EXPECT_FALSE(read(adapted(made()).document).corotational);
  // The patient's own document goes first, and is told where it is another's.
  patient_["corotational"] = false;
  EXPECT_THAT(adapted(made()).warnings, IsEmpty());
  EXPECT_FALSE(read(adapted(turning).document).corotational);
  EXPECT_THAT(adapted(turning).warnings, ElementsAre(HasSubstr("the patient's document says false")));
  patient_["corotational"] = true;
  EXPECT_TRUE(read(adapted(made()).document).corotational);
  EXPECT_THAT(adapted(made()).warnings, ElementsAre(HasSubstr("the patient's document says true")));
  // A template that was saved before this was kept says nothing of it.
  ordered_json old = turning;
  old.erase("corotational");
  EXPECT_THAT(adapted(old).warnings, IsEmpty());
  old["corotational"] = "yes";
  EXPECT_THAT(refused([&] { (void)adapted(old); }), HasSubstr("corotational is of type string"));
}

TEST_F(PlanTemplateTest, TellsWhereOnlyOneOfPlanAndPatientHasGravity) {
  const ordered_json weight = {
      {"region", "all"}, {"young_modulus_pa", 5000}, {"poisson_ratio", 0.4}, {"density_kg_m3", 1060}};
  plan_["materials"] = patient_["materials"] = {weight};
  const ordered_json weightless = made();
  EXPECT_EQ(weightless["gravity_m_s2"], ordered_json({0.0, 0.0, 0.0}));
  EXPECT_THAT(adapted(weightless).warnings, IsEmpty());
  plan_["gravity_m_s2"] = {0, 0, -9.81};
  const AdaptedPlan without = adapted(made());
  EXPECT_FALSE(without.document.contains("gravity_m_s2")) << "it is in another patient's frame";
  EXPECT_THAT(without.warnings, ElementsAre(HasSubstr("the patient's document has none")));
  patient_["gravity_m_s2"] = {0, -9.81, 0};
  const AdaptedPlan with = adapted(made());
  EXPECT_THAT(with.warnings, IsEmpty());
  EXPECT_EQ(with.document["gravity_m_s2"], patient_["gravity_m_s2"]);
  // The patient's own goes first here, too.
  const AdaptedPlan sags = adapted(weightless);
  EXPECT_THAT(sags.warnings, ElementsAre(HasSubstr("without gravity, and the patient's document has it")));
  EXPECT_EQ(sags.document["gravity_m_s2"], patient_["gravity_m_s2"]);
  // A template that was saved before this was kept says nothing of it.
  ordered_json old = weightless;
  old.erase("gravity_m_s2");
  EXPECT_THAT(adapted(old).warnings, IsEmpty());
}

TEST_F(PlanTemplateTest, SaysWhatIsNoTemplate) {
  const ordered_json sound = made();
  const auto told = [&](const char* pointer, const ordered_json& value) {
    ordered_json wrong = sound;
    wrong[ordered_json::json_pointer(pointer)] = value;
    return refused([&] { (void)adapted(wrong); });
  };
  EXPECT_THAT(told("/format", "kiroku-plan-seal/1"),
              HasSubstr("cannot use lift.template.json: it is no template"));
  EXPECT_THAT(told("/length_unit", "m"), HasSubstr("the template is in m and the patient's organ in mm"));
  EXPECT_THAT(told("/steps/0/at/from_surface", "near"),
              HasSubstr("steps[0].at.from_surface is of type string"));
  EXPECT_THAT(told("/steps/0/at", {{"position", {1, 2}}}), HasSubstr("steps[0].at.position"));
  EXPECT_THAT(told("/steps/2/path", 7), HasSubstr("steps[2].path"));
  EXPECT_THAT(told("/tools", 7), HasSubstr("tools"));
  EXPECT_THAT(told("/landmarks", ordered_json::object()),
              HasSubstr("there are 0 landmarks that both organs have"));
  own_landmarks_.erase("place 3");
  own_landmarks_.erase("place 4");
  own_landmarks_.erase("place 5");
  EXPECT_EQ(refused([&] { (void)made(); }),
            "there are 3 landmarks of the template, and it takes four at least: pick more")
      << "there is one organ here";
  own_landmarks_["place 3"] = own_landmarks_.begin()->second;
  EXPECT_THAT(refused([&] { (void)made(); }), HasSubstr("two landmarks of the template lie at one place"));
}

TEST_F(PlanTemplateTest, ReadsLandmarks) {
  std::ofstream(folder_ / "places.json") << R"({"length_unit": "mm", "landmarks": {"hilum": [1, -2, 3000]}})";
  const PlanLandmarks read = read_plan_landmarks(folder_ / "places.json");
  ASSERT_THAT(read, SizeIs(1));
  EXPECT_EQ(read.at("hilum"), Vector3(0.001, -0.002, 3));
  std::ofstream(folder_ / "wrong.json") << R"({"length_unit": "inch", "landmarks": {}})";
  EXPECT_THAT(refused([&] { (void)read_plan_landmarks(folder_ / "wrong.json"); }),
              HasSubstr("length_unit is 'inch': it must be 'm' or 'mm'"));
}

}  // namespace
}  // namespace kiroku::sim
