#include "sim/respiration/beam_tracking.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

using testing::HasSubstr;

constexpr double kHalfTurn = std::numbers::pi;

/// A breath of 4 s, `excursion_m` up and down, seen 25 times a second for `duration_s`.
SampledPath breathing(double excursion_m, double duration_s) {
  SampledPath path{0.04, {}};
  for (int i = 0; i * path.step_s <= duration_s; ++i)
    path.points_m.emplace_back(0.1, -0.2, excursion_m / 2 * std::sin(2 * kHalfTurn * i * path.step_s / 4));
  return path;
}

/// Breaths that differ by a fifth in length and depth, with a slow drift.
SampledPath irregular(double excursion_m, double duration_s) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> fifth(0.8, 1.2);
  SampledPath path{0.04, {}};
  double length = 4, depth = 1, phase = 0;
  for (int i = 0; i * path.step_s <= duration_s; ++i) {
    phase += path.step_s / length;
    if (phase >= 1) {
      phase -= 1;
      length = 4 * fifth(random);
      depth = fifth(random);
    }
    const double drift = 0.1 * std::sin(2 * kHalfTurn * i * path.step_s / 60);
    path.points_m.emplace_back(0, 0.3 * excursion_m * depth * std::pow(std::sin(kHalfTurn * phase), 2),
                               excursion_m * (depth * std::pow(std::sin(kHalfTurn * phase), 2) + drift));
  }
  return path;
}

TEST(SampledPath, IsThePathAtEvenSteps) {
  const TimedPath path{{1, 2, 3}, {Vector3(0, 0, 0), Vector3(0.01, 0, 0), Vector3(0.01, 0.02, 0)}};
  const SampledPath once = sampled(path, 4, {});
  ASSERT_EQ(once.points_m.size(), 9U);
  EXPECT_NEAR(once.points_m[2].x(), 0.005, 1e-12);
  EXPECT_NEAR(once.points_m[8].y(), 0.02, 1e-12);
  // From the last place to the first it takes as long as from the one before to the last.
  const SampledPath again = sampled(path, 4, 6.0);
  ASSERT_EQ(again.points_m.size(), 25U);
  EXPECT_NEAR(again.points_m[10].y(), 0.01, 1e-12);
  EXPECT_TRUE(again.points_m[12].isApprox(again.points_m[0]));
  EXPECT_TRUE(again.points_m[16].isApprox(again.points_m[4]));
  EXPECT_THROW(sampled(path, 0.5, {}), Error);
  EXPECT_THROW(sampled(path, 1000, 3600.0), Error);
}

TEST(SampledPath, IsScaledAboutItsMiddle) {
  const SampledPath path = irregular(0.012, 60), larger = scaled_to(path, 0.02);
  EXPECT_NEAR(excursion_m(larger), 0.02, 1e-9);
  double greatest = 0;
  for (const Vector3& a : larger.points_m) {
    for (const Vector3& b : larger.points_m) greatest = std::max(greatest, (a - b).norm());
  }
  EXPECT_NEAR(greatest, 0.02, 2e-5) << "by looking at every pair";
  Vector3 before = Vector3::Zero(), after = Vector3::Zero();
  for (std::size_t i = 0; i < path.points_m.size(); ++i) {
    before += path.points_m[i];
    after += larger.points_m[i];
  }
  EXPECT_TRUE(before.isApprox(after, 1e-9));
  EXPECT_THROW(scaled_to({1, std::vector<Vector3>(5, Vector3(1, 2, 3))}, 0.01), Error);
}

TEST(GimbalAngles, MeetThePlaceFromEverySide) {
  const Vector3 isocenter(0.02, 0.03, -0.1);
  const double ten_mm = std::atan2(0.01, 1) * 180 / kHalfTurn;
  const auto angles = [&](double gantry, const Vector3& offset) {
    return gimbal_angles({1, isocenter, gantry}, isocenter + offset);
  };
  EXPECT_NEAR(angles(0, {0, 0, 0.01}).tilt_deg, ten_mm, 1e-12);
  EXPECT_NEAR(angles(77, {0, 0, -0.01}).tilt_deg, -ten_mm, 1e-12);
  EXPECT_NEAR(angles(0, {0.01, 0, 0}).pan_deg, ten_mm, 1e-12);   // from the front: to the left
  EXPECT_NEAR(angles(90, {0, 0.01, 0}).pan_deg, ten_mm, 1e-12);  // from the left: to the back
  EXPECT_NEAR(angles(90, {0.01, 0, 0}).pan_deg, 0, 1e-12);       // along the beam
  // Nearer to the source the same way aside is a larger angle.
  EXPECT_NEAR(angles(0, {0.01, -0.2, 0}).pan_deg, std::atan2(0.01, 0.8) * 180 / kHalfTurn, 1e-12);
  EXPECT_THROW(angles(0, {0, -1.5, 0}), Error);
}

TEST(Prediction, OfARegularBreathIsNearlyExact) {
  const SampledPath path = breathing(0.02, 60);
  for (const double latency_s : {0.1, 0.3, 0.5}) {
    const LatencyError error = latency_error(path, latency_s);
    // A sine that is late by L is off by 2 A sin(pi L / T) at most.
    EXPECT_NEAR(error.delayed_mm.greatest, 20 * std::sin(kHalfTurn * error.latency_s / 4), 0.1);
    EXPECT_LT(error.predicted_mm.percentile_95, 0.05 * error.delayed_mm.percentile_95);
  }
}

TEST(Prediction, OfBreathsThatDifferHalvesTheError) {
  const SampledPath path = irregular(0.015, 120);
  double before = 0;
  for (const double latency_s : {0.1, 0.2, 0.3, 0.4, 0.5}) {
    const LatencyError error = latency_error(path, latency_s);
    EXPECT_LT(error.predicted_mm.mean, 0.5 * error.delayed_mm.mean) << latency_s;
    EXPECT_GT(error.predicted_mm.mean, before) << "further ahead less is known";
    before = error.predicted_mm.mean;
  }
}

TEST(Prediction, KnowsNothingOfWhatComes) {
  const SampledPath path = irregular(0.015, 60);
  SampledPath changed = path;
  constexpr std::size_t kFrom = 900;
  for (std::size_t at = kFrom; at < changed.points_m.size(); ++at) changed.points_m[at] += Vector3(1, 2, 3);
  const std::vector<Vector3> one = predicted(path, 0.3), other = predicted(changed, 0.3);
  for (std::size_t at = 0; at < kFrom; ++at) ASSERT_EQ(one[at], other[at]) << at;
  EXPECT_NE(one[kFrom], other[kFrom]);
}

TEST(Prediction, OfWhatRestsIsWhereItIs) {
  const SampledPath path{0.04, std::vector<Vector3>(1000, Vector3(0.1, 0.2, 0.3))};
  const LatencyError error = latency_error(path, 0.5);
  EXPECT_EQ(error.delayed_mm.greatest, 0);
  EXPECT_NEAR(error.predicted_mm.greatest, 0, 1e-9);
  EXPECT_THROW(latency_error(breathing(0.01, 15), 0.3), Error);
}

TEST(BeamFields, AreBallsAndTheWayBetween) {
  const double radius = 0.01, margin = 0.005, excursion = 0.02;
  const double ball = 4 * kHalfTurn / 3 * std::pow(radius, 3);
  const double field = 4 * kHalfTurn / 3 * std::pow(radius + margin, 3);
  const BeamFields fields = beam_fields(breathing(excursion, 80), {ball, margin, 0.3, 0.3});
  EXPECT_NEAR(fields.following_m3, field, 0.01 * field);
  const double covering = field + kHalfTurn * std::pow(radius + margin, 2) * excursion;
  EXPECT_NEAR(fields.covering_m3, covering, 0.01 * covering);
  EXPECT_GT(fields.gating_m3, fields.following_m3);
  EXPECT_LT(fields.gating_m3, fields.covering_m3);
  EXPECT_NEAR(fields.duty, 0.3, 0.03);
  EXPECT_NEAR(fields.covering_covered, 1, 1e-9);
  EXPECT_NEAR(fields.following_covered, 1, 1e-9) << "a regular breath is predicted well within the margin";
}

TEST(BeamFields, TellWhatABreathThatWasNotPlannedCosts) {
  // In its second half the tumour goes 30 mm further.
  SampledPath path = breathing(0.01, 120);
  for (std::size_t at = path.points_m.size() / 2; at < path.points_m.size(); ++at)
    path.points_m[at].z() += 0.03;
  const BeamFields fields = beam_fields(path, {4e-6, 0.005, 0.3, 0.3});
  EXPECT_LT(fields.covering_covered, 0.05);
  EXPECT_EQ(fields.duty, 0) << "the tumour is never in the gate";
  EXPECT_EQ(fields.gating_covered, 0);
  EXPECT_GT(fields.following_covered, 0.95) << "it misses until the step is learnt";
}

TEST(BeamFields, WithoutAMarginTheFollowingBeamMissesWhatIsNotPredicted) {
  const SampledPath path = irregular(0.02, 120);
  const auto covered = [&](double margin_m) {
    return beam_fields(path, {4e-6, margin_m, 0.3, 0.5}).following_covered;
  };
  const double without = covered(0), little = covered(0.0002);
  EXPECT_LT(without, 0.9995);
  EXPECT_GT(little, without);
  EXPECT_NEAR(covered(0.01), 1, 1e-12);
}

TEST(BeamFields, RefuseWhatIsNone) {
  const SampledPath path = breathing(0.01, 40);
  const auto refusal = [&](const BeamFieldTerms& terms) -> std::string {
    try {
      beam_fields(path, terms);
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing was refused";
  };
  EXPECT_THAT(refusal({0, 0.005}), HasSubstr("the tumour's volume"));
  EXPECT_THAT(refusal({NAN, 0.005}), HasSubstr("the tumour's volume"));
  EXPECT_THAT(refusal({1e-6, -0.001}), HasSubstr("the margin"));
  EXPECT_THAT(refusal({1e-6, 0.005, 0}), HasSubstr("the gate's part of the time"));
  EXPECT_THROW(beam_fields(breathing(0.31, 40), {1e-6, 0.005}), Error) << "another unit";
  EXPECT_THROW(beam_fields({0.04, std::vector<Vector3>(9, Vector3::Zero())}, {1e-6, 0.005}), Error);
}

}  // namespace
}  // namespace kiroku::sim
