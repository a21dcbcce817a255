// How a patient lay and breathed is found again from the radiographs alone, and what cannot be found is
// refused.
#include "sim/respiration/series_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/drr/registration.h"
#include "sim/respiration/gradient_terms.h"
#include "tests/unit/sim/respiration/box_chest.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

constexpr double kRadians = 3.14159265358979 / 180;

struct Chest {
  explicit Chest(const Volume& volume = test::box_chest()) : scene(model, volume) {}
  BreathingModel model = test::box_lung_model();
  BreathingScene scene;
};

test::ChestTruth truth_of(const BreathingScene& scene) {
  test::ChestTruth truth;
  truth.pose = rigid_motion({0.008, -0.005, 0.009}, kRadians * Vector3(3, -4, 2), scene.middle_m());
  truth.motion.rib_cage = {0.003, 0.3, std::nullopt, 0.001, 0};
  truth.motion.diaphragm = {0.009, 0.8, std::nullopt, -0.003, 0.0002};
  truth.noise = 0.02;
  return truth;
}

TEST(BreathingPictures, BetweenNodesAPictureIsThatOfTheState) {
  const Chest chest;
  const ProjectionGeometry view = test::chest_view(0);
  // A node a pixel: the box's flat floor is an edge along a row, the worst there is.
  const BreathingPictures table(chest.scene, view, StateAxis::covering(-0.004, 0.004, 0.004),
                                StateAxis::covering(-0.01, 0.01, 0.0026));
  const BreathState state{0.0013, -0.0047};
  BreathingPictures::Looked looked;
  table.look_up(state, looked);
  ProjectionImage truth = chest.scene.moving(view, state);
  add_to(truth, chest.scene.still(view));
  const ProjectionImage found{truth.columns, truth.rows, looked.value};
  EXPECT_GT(gradient_correlation(truth, found), 0.99);
  // The slope is that of the table itself.
  BreathingPictures::Looked more, less;
  constexpr double kStepM = 1e-4;
  table.look_up({state.rib_cage_m, state.diaphragm_m + kStepM}, more);
  table.look_up({state.rib_cage_m, state.diaphragm_m - kStepM}, less);
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < looked.value.size(); ++i) {
    const double slope = (double(more.value[i]) - double(less.value[i])) / (2 * kStepM);
    difference += std::pow(slope - double(looked.by_diaphragm[i]), 2);
    size += std::pow(slope, 2);
  }
  EXPECT_LT(difference, 1e-4 * size);
}

TEST(GradientTerms, AreGradientCorrelationAndItsSlope) {
  const Chest chest;
  const ProjectionGeometry view = test::chest_view(20);
  ProjectionImage measured = chest.scene.moving(view, {0.002, 0.006});
  add_to(measured, chest.scene.still(view));
  const BreathingPictures table(chest.scene, view, StateAxis::covering(-0.004, 0.004, 0.004),
                                StateAxis::covering(-0.01, 0.01, 0.004));
  BreathingPictures::Looked looked;
  const auto terms_at = [&](const BreathState& state) {
    table.look_up(state, looked);
    const std::array<const float*, 2> slopes{looked.by_rib_cage.data(), looked.by_diaphragm.data()};
    return gradient_terms(measured, looked.value, slopes, {});
  };
  const BreathState state{0.001, 0.003};
  const GradientTerms terms = terms_at(state);
  EXPECT_NEAR(terms.similarity,
              gradient_correlation(measured, {measured.columns, measured.rows, looked.value}), 1e-4);
  constexpr double kStepM = 5e-5;
  const double slope = (terms_at({state.rib_cage_m, state.diaphragm_m + kStepM}).log_misfit -
                        terms_at({state.rib_cage_m, state.diaphragm_m - kStepM}).log_misfit) /
                       (2 * kStepM);
  // ln (1 - c^2) changes by twice what a step of least squares sees, but for its weight.
  const double n = 127 * 127 / kSharedDifferences;
  EXPECT_NEAR(-2 * terms.right[1] / n, slope, 0.02 * std::abs(slope));
}

TEST(SeriesFit, PoseAndBreathingAreFoundFromTwoViews) {
  const Chest truth_chest;
  const test::ChestTruth truth = truth_of(truth_chest.scene);
  const std::vector<ProjectionGeometry> views{test::chest_view(0), test::chest_view(90)};
  const std::vector<SeriesPicture> pictures = test::chest_radiographs(truth_chest.scene, views, truth);
  Chest chest;
  const SeriesFit fit = fit_series(chest.model, chest.scene, views, pictures);
  EXPECT_EQ(fit.refusal, "");
  EXPECT_EQ(fit.moments.size(), truth.moments);
  const Vector3 centre_m = chest.scene.middle_m();
  EXPECT_LT((fit.pose * centre_m - truth.pose * centre_m).norm(), 0.0007);
  EXPECT_LT(Eigen::AngleAxisd((fit.pose.linear().transpose() * truth.pose.linear()).eval()).angle(),
            0.7 * kRadians);
  EXPECT_NEAR(fit.motion.diaphragm.amplitude_m, truth.motion.diaphragm.amplitude_m, 0.0008);
  EXPECT_NEAR(fit.motion.diaphragm.baseline_m, truth.motion.diaphragm.baseline_m, 0.0008);
  EXPECT_NEAR(fit.waveform.duration_s(), 3.6, 0.05);
  EXPECT_NEAR(fit.motion.rib_cage.amplitude_m, truth.motion.rib_cage.amplitude_m, 0.0008);
  EXPECT_GT(fit.diaphragm.explained, 0.9);
  EXPECT_GT(fit.similarity_after, 0.9);
  EXPECT_GT(fit.change, 0.5);
  // What is told of errors is about what they are.
  EXPECT_LT(std::abs(fit.motion.diaphragm.amplitude_m - truth.motion.diaphragm.amplitude_m),
            6 * fit.diaphragm.amplitude_error_m + 0.0001);
}

TEST(SeriesFit, APatientWhoLiesAsGivenStaysThere) {
  const Chest truth_chest;
  test::ChestTruth truth = truth_of(truth_chest.scene);
  truth.pose = Eigen::Isometry3d::Identity();
  truth.moments = 24;
  truth.motion.diaphragm.direction = Vector3(0, 0.28, -0.96);
  Chest chest, turned;
  turned.model.motion.diaphragm.direction = truth.motion.diaphragm.direction;
  const BreathingScene truth_scene(turned.model, test::box_chest());
  const std::vector<ProjectionGeometry> views{test::chest_view(0), test::chest_view(90)};
  const std::vector<SeriesPicture> pictures = test::chest_radiographs(truth_scene, views, truth);
  const SeriesFit fit = fit_series(chest.model, chest.scene, views, pictures,
                                   {.direction = true, .lies_as_given = true, .progress = {}});
  EXPECT_EQ(fit.refusal, "");
  EXPECT_THAT(fit.findings, testing::IsEmpty());
  EXPECT_TRUE(fit.pose.isApprox(Eigen::Isometry3d::Identity(), 0));
  EXPECT_EQ(fit.pose_covariance.norm(), 0);
  EXPECT_NEAR(fit.motion.diaphragm.amplitude_m, truth.motion.diaphragm.amplitude_m, 0.0008);
  EXPECT_NEAR(fit.motion.rib_cage.amplitude_m, truth.motion.rib_cage.amplitude_m, 0.0008);
  EXPECT_GT(fit.motion.diaphragm.direction->dot(*truth.motion.diaphragm.direction), 0.99);
  EXPECT_EQ(fit.similarity_before, fit.similarity_posed);

  // Where the pictures say that the patient lies elsewhere, that is told, and not done.
  truth.pose = rigid_motion({0.012, 0, 0.012}, kRadians * Vector3(0, 5, 0), truth_scene.middle_m());
  const SeriesFit elsewhere =
      fit_series(chest.model, chest.scene, views, test::chest_radiographs(truth_scene, views, truth),
                 {.direction = false, .lies_as_given = true, .progress = {}});
  EXPECT_THAT(elsewhere.findings,
              testing::Contains(HasSubstr("find that first, with kiroku sim fit-series")));
  EXPECT_TRUE(elsewhere.pose.isApprox(Eigen::Isometry3d::Identity(), 0));
}

TEST(SeriesFit, SaysWhereTheBreathsLengthEndsWhereTheSearchDoes) {
  const Chest truth_chest;
  test::ChestTruth truth = truth_of(truth_chest.scene);
  truth.pose = Eigen::Isometry3d::Identity();
  const std::vector<ProjectionGeometry> views{test::chest_view(0)};
  const auto findings_of = [&](double breath_s) {
    truth.waveform = Waveform(SineWave{breath_s});
    Chest chest;  // its document has a breath of 3.6 s
    return fit_series(chest.model, chest.scene, views,
                      test::chest_radiographs(truth_chest.scene, views, truth),
                      {.direction = false, .lies_as_given = true, .progress = {}})
        .findings;
  };
  EXPECT_THAT(findings_of(6.5),
              testing::Contains("the breath's length ends where the search does, at 5.76 s, 1.6 times the "
                                "given one of 3.6 s: the patient's may be longer; give one that is nearer "
                                "to it"));
  EXPECT_THAT(findings_of(2),
              testing::Contains(testing::AllOf(HasSubstr("ends where the search does, at 2.16 s, 0.6 times"),
                                               HasSubstr("may be shorter"))));
  EXPECT_THAT(findings_of(5.4), testing::Not(testing::Contains(HasSubstr("the breath's length"))));
}

TEST(SeriesFit, ACouchThatIsNotInTheCtDoesNotPull) {
  const Chest truth_chest;
  const test::ChestTruth truth = truth_of(truth_chest.scene);
  const std::vector<ProjectionGeometry> views{test::chest_view(0), test::chest_view(90)};
  std::vector<SeriesPicture> pictures = test::chest_radiographs(truth_chest.scene, views, truth);
  for (SeriesPicture& picture : pictures) {
    for (std::size_t row = 0; row < 128; ++row) {
      for (std::size_t column = 96; column < 101; ++column) picture.image.values[row * 128 + column] += 1.5F;
    }
  }
  Chest chest;
  const SeriesFit fit = fit_series(chest.model, chest.scene, views, pictures);
  EXPECT_EQ(fit.refusal, "");
  const Vector3 centre_m = chest.scene.middle_m();
  EXPECT_LT((fit.pose * centre_m - truth.pose * centre_m).norm(), 0.0012);
  EXPECT_NEAR(fit.motion.diaphragm.amplitude_m, truth.motion.diaphragm.amplitude_m, 0.0008);
}

TEST(SeriesFit, RefusesWhatTheCtDoesNotExplain) {
  const Chest truth_chest;
  test::ChestTruth truth = truth_of(truth_chest.scene);
  truth.moments = 12;
  const std::vector<ProjectionGeometry> views{test::chest_view(0)};
  const std::vector<SeriesPicture> pictures = test::chest_radiographs(truth_chest.scene, views, truth);
  Chest chest;

  std::vector<SeriesPicture> mirrored = pictures;
  for (SeriesPicture& picture : mirrored) {
    for (std::size_t row = 0; row < 128; ++row) {
      const auto line = picture.image.values.begin() + static_cast<std::ptrdiff_t>(row * 128);
      std::reverse(line, line + 128);
    }
  }
  EXPECT_THAT(fit_series(chest.model, chest.scene, views, mirrored).refusal,
              testing::AllOf(HasSubstr("but mirrored left to right to"), HasSubstr("tried: ")));

  std::vector<SeriesPicture> dark = pictures;
  for (SeriesPicture& picture : dark) {
    for (float& value : picture.image.values) value = 9 - value;
  }
  EXPECT_THAT(fit_series(chest.model, chest.scene, views, dark).refusal,
              HasSubstr("give --polarity bone-black"));

  std::vector<SeriesPicture> other = pictures;
  for (SeriesPicture& picture : other) {
    for (std::size_t i = 0; i < picture.image.values.size(); ++i) {
      const double column = double(i % 128), row = double(i / 128);
      picture.image.values[i] =
          static_cast<float>(3 + std::sin(0.31 * column + picture.time_s) * std::cos(0.17 * row));
    }
  }
  EXPECT_THAT(fit_series(chest.model, chest.scene, views, other).refusal,
              HasSubstr("another patient's series"));
}

TEST(SeriesFit, RefusesASeriesWithoutBreathing) {
  const Chest truth_chest;
  test::ChestTruth truth = truth_of(truth_chest.scene);
  truth.motion.rib_cage.amplitude_m = truth.motion.diaphragm.amplitude_m = 0;
  truth.motion.diaphragm.drift_m_per_s = 0;
  const std::vector<ProjectionGeometry> views{test::chest_view(0)};
  Chest chest;
  const SeriesFit fit =
      fit_series(chest.model, chest.scene, views, test::chest_radiographs(truth_chest.scene, views, truth));
  EXPECT_THAT(fit.refusal, testing::AllOf(HasSubstr("no breathing was found"), HasSubstr("by chance")));
}

TEST(SeriesFit, SaysWhatItLacks) {
  Chest chest;
  const std::vector<ProjectionGeometry> views{test::chest_view(0)};
  test::ChestTruth truth;
  truth.moments = 5;
  const auto refusal = [&](const std::vector<SeriesPicture>& pictures) -> std::string {
    try {
      static_cast<void>(fit_series(chest.model, chest.scene, views, pictures));
    } catch (const Error& error) {
      return error.what();
    }
    return "taken";
  };
  std::vector<SeriesPicture> pictures = test::chest_radiographs(chest.scene, views, truth);
  EXPECT_THAT(refusal(pictures), HasSubstr("the series has 5 moments; 8 at least"));
  pictures.front().image = {4, 4, std::vector<float>(16, 0.0F)};
  EXPECT_THAT(refusal(pictures), HasSubstr("picture 0 has 4 x 4 pixels, the geometry 128 x 128"));
  EXPECT_THAT(refusal({}), HasSubstr("no picture is of geometry 1"));
}

}  // namespace
}  // namespace kiroku::sim
