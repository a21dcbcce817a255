// What moves the lung, by the formula of the source.
#include "sim/respiration/breathing.h"

#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/mesh/degrees_of_freedom.h"
#include "sim/respiration/motion_responses.h"
#include "tests/unit/sim/respiration/box_lung.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

class BreathingLung : public testing::Test {
 protected:
  [[nodiscard]] BreathingBody body() const { return {mesh_, materials_, groups_, Vector3(0, 0, 1)}; }

  BreathingModel model_ = test::box_lung_model();
  const TetMesh& mesh_ = model_.mesh;
  const Materials& materials_ = model_.materials;
  const BoundaryGroups& groups_ = model_.groups;
};

TEST_F(BreathingLung, MovesEachGroupAsTheFormulaSays) {
  const BreathingMotion motion{{0.004, 0.1, std::nullopt}, {0.012, 0.6, Vector3(0, 0.6, -0.8)}};
  const BreathingBody lung = body();
  const BreathingCycle cycle(lung, motion, Waveform(SineWave{3.6}));
  for (const double time_s : {0.0, 0.7, 1.9, 3.5}) {
    const Eigen::VectorXd displacement_m = cycle.displacement_m(time_s);
    const auto sine = [&](double phase_s) {
      return std::sin(2 * std::numbers::pi / 3.6 * (time_s + phase_s));
    };
    for (std::size_t node = 0; node < groups_.size(); ++node) {
      const Vector3 moved_m = displacement_m.segment<3>(first_row(node));
      if (groups_[node] == BoundaryGroup::kRibCage) {
        const Vector3& normal = lung.surface().normals[static_cast<std::size_t>(lung.surface().row_of[node])];
        EXPECT_LT((moved_m - 0.004 * sine(0.1) * normal).norm(), 1e-15);
      } else if (groups_[node] == BoundaryGroup::kDiaphragm) {
        EXPECT_LT((moved_m - 0.012 * sine(0.6) * Vector3(0, 0.6, -0.8)).norm(), 1e-15);
      } else if (groups_[node] == BoundaryGroup::kTrachea) {
        EXPECT_EQ(moved_m, Vector3::Zero());
      }
    }
  }
}

TEST_F(BreathingLung, TheBackSlidesInItsDirectionOnly) {
  const Vector3 slide = Vector3(0.1, 0.2, 1).normalized();
  const BreathingBody lung(mesh_, materials_, groups_, slide);
  const Eigen::VectorXd moved = lung.response(BoundaryGroup::kDiaphragm, std::nullopt);
  double farthest = 0;
  for (std::size_t node = 0; node < groups_.size(); ++node) {
    if (groups_[node] != BoundaryGroup::kBack) continue;
    const Vector3 vector = moved.segment<3>(first_row(node));
    EXPECT_LT((vector - slide * slide.dot(vector)).norm(), 1e-12);
    farthest = std::max(farthest, vector.norm());
  }
  EXPECT_GT(farthest, 0.05);
}

TEST_F(BreathingLung, OneFactorAndResponsesAreWhatASolveOfEachMomentGives) {
  const BreathingMotion motion;
  const BreathingCycle cycle(body(), motion, Waveform(SineWave{3.6}));
  const LungSurface surface = surface_of(mesh_);
  constexpr double kTimeS = 0.55;
  // The same moment, prescribed and solved for by itself.
  Constraints constraints(mesh_.nodes.size());
  const auto turns = [](double seconds) { return std::sin(2 * std::numbers::pi * seconds / 3.6); };
  for (std::size_t node = 0; node < groups_.size(); ++node) {
    const auto prescribe_normal = [&](double moved_m) {
      constraints.prescribe(node, moved_m * surface.normals[static_cast<std::size_t>(surface.row_of[node])],
                            "test");
    };
    if (groups_[node] == BoundaryGroup::kRibCage)
      prescribe_normal(motion.rib_cage.amplitude_m * turns(kTimeS));
    if (groups_[node] == BoundaryGroup::kDiaphragm)
      prescribe_normal(motion.diaphragm.amplitude_m * turns(kTimeS + motion.diaphragm.phase_s));
    if (groups_[node] == BoundaryGroup::kTrachea) constraints.prescribe(node, Vector3::Zero(), "test");
    if (groups_[node] == BoundaryGroup::kBack) {
      constraints.prescribe(node, 0, 0, "test");
      constraints.prescribe(node, 1, 0, "test");
    }
  }
  const ElasticBody solved(mesh_, materials_, constraints);
  const Eigen::VectorXd expected_m =
      solved.solve(Eigen::VectorXd::Zero(first_row(mesh_.nodes.size()))).displacement_m;
  EXPECT_LT((cycle.displacement_m(kTimeS) - expected_m).cwiseAbs().maxCoeff(),
            1e-9 * expected_m.cwiseAbs().maxCoeff());
}

TEST_F(BreathingLung, SumsOfUnitMotionsAreWhatASolveOfEachMotionGives) {
  const BreathingBody lung = body();
  std::size_t heard = 0;
  const MotionResponses responses(lung, [&](std::size_t solved) { heard = solved; });
  EXPECT_EQ(heard, kUnitMotions);
  const MeshPoint tumour = centre_of(mesh_, tumour_of_region(mesh_, 2));
  const MotionResponses::Place place = responses.at(tumour);
  const Waveform waveform(SineWave{4.1});
  BreathingMotion normals;
  normals.diaphragm.baseline_m = 0.002;
  BreathingMotion slanted = normals;
  slanted.rib_cage.direction = Vector3(0.6, -0.8, 0);
  slanted.diaphragm.direction = Vector3(0.1, 0.2, -0.9).normalized();
  slanted.diaphragm.drift_m_per_s = 0.0003;
  for (const BreathingMotion& motion : {normals, slanted}) {
    const BreathingCycle cycle(lung, motion, waveform);
    for (const double time_s : {0.0, 1.3, 9.7}) {
      const Eigen::VectorXd expected_m = cycle.displacement_m(time_s);
      const std::vector<Vector3> found_m = responses.displacement_m(motion, waveform, time_s);
      ASSERT_EQ(found_m.size(), mesh_.nodes.size());
      for (std::size_t node = 0; node < found_m.size(); ++node)
        EXPECT_LT((found_m[node] - expected_m.segment<3>(first_row(node))).norm(), 1e-13);
      EXPECT_LT((place.displacement_m(motion, waveform, time_s) - tumour.mean(expected_m)).norm(), 1e-13);
    }
  }
}

TEST_F(BreathingLung, TheTumourIsHarderThanTheLungAndGoesWithIt) {
  const Tumour tumour = tumour_of_region(mesh_, 2);
  const MeshPoint centre = centre_of(mesh_, tumour);
  const BreathingCycle cycle(body(), {}, Waveform(SineWave{3.6}));
  const Eigen::VectorXd displacement_m = cycle.displacement_m(0.9 - 0.6);
  EXPECT_LT(centre.mean(displacement_m).z(), -0.001);
  EXPECT_GT(centre.mean(displacement_m).z(), -0.01);
  const BreathingBody lung = body();
  double in_tumour = 0, beside = 0;
  const std::vector<SymmetricTensor> strain = lung.body().strain(displacement_m);
  for (std::size_t t = 0; t < strain.size(); ++t) {
    double& largest = mesh_.regions[t] == 2 ? in_tumour : beside;
    largest = std::max(largest, strain[t].norm());
  }
  EXPECT_LT(in_tumour, 0.1 * beside);
}

TEST_F(BreathingLung, ATumourMustBeInTheMesh) {
  try {
    static_cast<void>(tumour_of_region(mesh_, 7));
    FAIL() << "there is none";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("nothing of the mesh is of region 7, which should be tumour; it has 1, 2"));
  }
  EXPECT_THROW(static_cast<void>(tumour_in_ball(mesh_, Vector3(1, 1, 1), 0.01)), Error);
  const Tumour ball = tumour_in_ball(mesh_, test::kBoxTumourM, 0.03);
  EXPECT_LT((centre_of(mesh_, ball).mean(mesh_.nodes) - test::kBoxTumourM).norm(), 0.01);
}

TEST(Waveforms, BreathsDriftAndDifferInDepthWithoutJumps) {
  const Waveform wave(std::vector<Breath>{{4, 1, 0}, {3, 1.5, 0.2}, {5, 0.7, -0.1}});
  EXPECT_EQ(wave.duration_s(), 12);
  EXPECT_FALSE(wave.periodic());
  EXPECT_NEAR(wave.at(1), 1 + 0.05, 1e-12);
  EXPECT_NEAR(wave.at(4), 0.2, 1e-12);
  EXPECT_NEAR(wave.at(4 + 0.75), 0.2 - 0.3 * 0.25 + 1.5, 1e-12);
  EXPECT_NEAR(wave.at(100), -0.1, 1e-12);
  for (double time_s = -1; time_s < 13; time_s += 0.01)
    EXPECT_LT(std::abs(wave.at(time_s + 0.01) - wave.at(time_s)), 0.05) << time_s;
}

TEST(Waveforms, ATraceIsCountedInHalfBreathsAboutItsMean) {
  std::string text = "# patient 3\ntime_ms,beam,amplitude\n";
  for (int i = 0; i <= 360; ++i)
    text += std::to_string(1000 + 100 * i) + ",1," +
            std::to_string(7 + 4 * std::sin(2 * std::numbers::pi * i / 36)) + "\n";
  const Waveform wave(parse_breathing_trace(text, "rpm.csv"));
  EXPECT_NEAR(wave.duration_s(), 36, 1e-12);
  EXPECT_EQ(wave.begins_s(), 0);
  for (double time_s = 0; time_s < 36; time_s += 0.1)
    EXPECT_NEAR(wave.at(time_s), std::sin(2 * std::numbers::pi * time_s / 3.6), 0.03);
}

TEST(Waveforms, WhatIsWrongWithATraceIsToldByItsLine) {
  const auto refusal = [](const std::string& text) -> std::string {
    try {
      static_cast<void>(parse_breathing_trace(text, "rpm.csv"));
    } catch (const Error& error) {
      return error.what();
    }
    return "taken";
  };
  EXPECT_THAT(
      refusal("time_s,amplitude\n0,1\n1,2\n0.5,3\n"),
      HasSubstr(
          "cannot use rpm.csv, line 4: it is not later than the line before it: sort the trace by time"));
  EXPECT_THAT(refusal("time_s,amplitude\n0,1\n1,high\n"),
              HasSubstr("line 3: it has 'high' as its amplitude"));
  EXPECT_THAT(refusal("time_s,amplitude\n0,1\n1,nan\n"), HasSubstr("'nan' as its amplitude"));
  EXPECT_THAT(refusal("time_s,amplitude\n0,1,2\n"), HasSubstr("line 2: it has 3 fields"));
  EXPECT_THAT(refusal("time_s,depth\n0,1\n"), HasSubstr("no column 'amplitude'; it has 'time_s', 'depth'"));
  EXPECT_THAT(refusal("amplitude\n1\n2\n"), HasSubstr("one column of times"));
  EXPECT_THAT(refusal("time_s,amplitude\n0,1\n"), HasSubstr("fewer than two samples"));
  EXPECT_THAT(refusal("time_s,amplitude\n0,1\n1,1\n2,1\n"), HasSubstr("does not move"));
  EXPECT_THAT(refusal(""), HasSubstr("it is empty"));
}

TEST(Waveforms, NumbersWithoutSenseAreRefused) {
  EXPECT_THROW(Waveform(SineWave{0}), Error);
  EXPECT_THROW(Waveform(SineWave{std::nan("")}), Error);
  EXPECT_THROW(Waveform(std::vector<Breath>{}), Error);
  EXPECT_THROW(Waveform(std::vector<Breath>{{3, std::nan(""), 0}}), Error);
  EXPECT_THROW(Waveform(BreathingTrace{{0, 1, 1}, {0, 1, 2}}), Error);
  EXPECT_THROW(Waveform(BreathingTrace{{0}, {0}}), Error);
}

}  // namespace
}  // namespace kiroku::sim
