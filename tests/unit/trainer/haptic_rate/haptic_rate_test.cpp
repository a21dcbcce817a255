#include <algorithm>
#include <cmath>

#include <boost/math/distributions/normal.hpp>
#include <gtest/gtest.h>

#include "base/error.h"
#include "trainer/haptic_rate/experiment.h"
#include "trainer/haptic_rate/held_forces.h"
#include "trainer/psychophysics/rate_series.h"
#include "trainer/psychophysics/threshold_posterior.h"

namespace kiroku::trainer {
namespace {

using sim::Vector3;

const Plate& plate() {
  static const Plate kPlate;
  return kPlate;
}

TEST(Plate, HasTheSizeOfThePapers) {
  const sim::TetMesh& mesh = plate().body().mesh();
  EXPECT_NEAR(static_cast<double>(mesh.nodes.size()), 1334, 133);
  EXPECT_NEAR(static_cast<double>(mesh.tetrahedra.size()), 4745, 474);
  const sim::Extent extent = sim::extent_of(mesh);
  EXPECT_TRUE((extent.greatest - extent.least).isApprox(Vector3(0.2, 0.2, 0.015)));
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node)
    EXPECT_EQ(plate().body().free_components(node) == 0, std::abs(mesh.nodes[node].x()) > 0.0849) << node;
}

TEST(Plate, IsPressedWithTheForceThatIsWanted) {
  for (std::size_t count = 1; count <= kMostFingers; ++count) {
    for (const double wanted_n : {kLeastPressN, kMostPressN}) {
      const std::vector<sim::Pose> poses = plate().pressing(count, wanted_n);
      PlateForces contact(plate(), poses);
      std::vector<Vector3> forces_n(count);
      contact.forces(poses, 1e-3, forces_n);
      for (const Vector3& force_n : forces_n) EXPECT_NEAR(force_n.z(), wanted_n, 2e-3 * wanted_n);
    }
  }
  EXPECT_THROW((void)plate().pressing(6, 1), UsageError);
}

TEST(Plate, IsBlueWhereItIsPressedLightlyAndRedWhereFirmly) {
  EXPECT_EQ(colour_of_press(0.5), (sim::Rgb{0, 0, 255}));
  EXPECT_EQ(colour_of_press(1.0), (sim::Rgb{255, 0, 0}));
  EXPECT_EQ(colour_of_press(0.75), (sim::Rgb{128, 0, 128}));
  EXPECT_EQ(colour_of_press(0), colour_of_press(0.5));
  EXPECT_EQ(colour_of_press(9), colour_of_press(1.0));
}

TEST(HeldForces, HoldTheWristsForceAsLong) {
  class Growing : public sim::ForceSource {
   public:
    void forces(std::span<const sim::Pose>, double, std::span<Vector3> forces_n) override {
      forces_n[0] = {0, 0, ++times};
    }
    sim::WristForce wrist_force(const Vector3& wrist_m) override { return {{0, 0, times}, times * wrist_m}; }
    double times = 0;
  } source;
  HeldForces held(source, 100);
  std::vector<sim::Pose> poses(1);
  std::vector<Vector3> forces_n(1);
  for (int step = 0; step < 60; ++step) {  // at 2 kHz a renewal is due every twenty steps
    held.forces(poses, 5e-4, forces_n);
    const sim::WristForce wrist = held.wrist_force({1 + step % 20 / 100.0, 0, 0});
    EXPECT_EQ(wrist.force_n, forces_n[0]) << step;
    EXPECT_EQ(wrist.torque_nm.x(), forces_n[0].z()) << step;  // about where it was at the renewal
  }
  EXPECT_EQ(source.times, 3);
}

TEST(HeldForces, AreRenewedAtTheRatesOfBothSeries) {
  class Counter : public sim::ForceSource {
   public:
    void forces(std::span<const sim::Pose>, double period_s, std::span<Vector3> forces_n) override {
      forces_n[0].x() = ++times;
      told_s += period_s;
    }
    double times = 0, told_s = 0;
  };
  for (const RateSeries series : {RateSeries::kHapticRate, RateSeries::kExclusion}) {
    for (std::size_t i = 1; i <= rates_of(series); ++i) {
      Counter source;
      HeldForces held(source, rate_hz(series, i));
      std::vector<sim::Pose> poses(1);
      std::vector<Vector3> forces_n(1);
      constexpr double kPeriodSeconds = 5e-4;
      const auto steps = static_cast<int>(std::lround(10 / rate_hz(series, i) / kPeriodSeconds));
      for (int step = 0; step < steps; ++step) held.forces(poses, kPeriodSeconds, forces_n);
      EXPECT_EQ(source.times, 10) << name_of(series) << " " << i;
      EXPECT_EQ(forces_n[0].x(), 10);
    }
  }
  Counter source;
  EXPECT_THROW(HeldForces(source, 0), UsageError);
}

TEST(PressPlate, IsFeltAtTheRateThatIsGiven) {
  for (std::size_t fingers = 1; fingers <= kMostFingers; ++fingers) {
    for (const RateSeries series : {RateSeries::kHapticRate, RateSeries::kExclusion}) {
      for (const std::size_t i : {std::size_t{2}, std::size_t{18}, std::size_t{118}, rates_of(series)}) {
        const double given_hz = rate_hz(series, i);
        EXPECT_NEAR(press_plate(plate(), fingers, given_hz).renewed_hz, given_hz, 1e-9 * given_hz)
            << fingers << " " << i;
      }
    }
    EXPECT_NEAR(press_plate(plate(), fingers, 100).renewed_hz, 100, 1e-7) << fingers;
    const FeltForces smooth = press_plate(plate(), fingers, 100);
    EXPECT_NEAR(smooth.least_n, kLeastPressN, 0.1) << fingers;
    EXPECT_NEAR(smooth.greatest_n, kMostPressN, 0.1) << fingers;
  }
}

TEST(SimulatedSubject, AnswersByTheRateItFelt) {
  SimulatedSubject subject(plate(), {{1, {8.8, 0.01, 0}}}, 1);
  EXPECT_TRUE(subject.feels_vibration(1, 5.1));
  EXPECT_FALSE(subject.feels_vibration(1, 31));
  EXPECT_THROW((void)subject.feels_vibration(2, 10), UsageError);
  EXPECT_THROW(SimulatedSubject(plate(), {{1, {0, 0.1, 0}}}, 1), UsageError);
  EXPECT_THROW(SimulatedSubject(plate(), {{1, {3, 0.1, 1}}}, 1), UsageError);
}

TEST(RateExperiment, ThePapersMeansFallOutOfSubjectsThatHaveThem) {
  const std::vector<double> means_hz{23.3, 8.8, 3.0, 1.3, 1.2};
  std::vector<ConditionMean> means;
  for (std::size_t count = 1; count <= means_hz.size(); ++count)
    means.push_back({count, means_hz[count - 1]});
  const auto functions = scaled_group(means, 6, 0.05, 0.08, 0.02, 5);
  for (std::size_t count = 0; count < means_hz.size(); ++count) {
    double sum = 0;
    for (const auto& subject : functions) sum += subject.at(count + 1).threshold_hz;
    EXPECT_NEAR(sum / 6, means_hz[count], 1e-12);
  }
  std::vector<RateSession> sessions;
  for (std::size_t i = 0; i < functions.size(); ++i) {
    SimulatedSubject subject(plate(), functions[i], static_cast<std::uint32_t>(i));
    sessions.push_back(run_rate_session(subject, {}));
    EXPECT_EQ(sessions.back().trials.size(), 300U);
  }
  const RateComparison found = compare_fingers(sessions);
  ASSERT_EQ(found.groups.size(), 5U);
  ASSERT_EQ(found.pairs.size(), 10U);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(found.groups[i].hz.mean / means_hz[i], 1, 0.06) << i + 1;
    RecordProperty("fingers_" + std::to_string(i + 1), std::to_string(found.groups[i].hz.mean));
  }
  for (const RatePair& pair : found.pairs) {
    ASSERT_TRUE(pair.adjusted_p);
    if (pair.second == Fingers(5) && pair.first == Fingers(4)) continue;  // 1.3 and 1.2 Hz
    EXPECT_LT(*pair.adjusted_p, 0.01) << pair.first.text() << " " << pair.second.text();
    EXPECT_GE(*pair.adjusted_p, pair.of_log10.test->p);
  }
}

TEST(RateExperiment, EachStudyHasItsOwnThresholds) {
  EXPECT_EQ(published_threshold_hz(RateSeries::kHapticRate, 1), 23.3);
  EXPECT_EQ(published_threshold_hz(RateSeries::kHapticRate, 5), 1.2);
  EXPECT_EQ(published_threshold_hz(RateSeries::kExclusion, 1), 15.8);
  EXPECT_EQ(published_threshold_hz(RateSeries::kExclusion, 2), 4.2);
  EXPECT_FALSE(published_threshold_hz(RateSeries::kExclusion, 3));
  EXPECT_EQ(published_threshold_hz(RateSeries::kExclusion, Fingers::of("middle+third")), 3.5);
  EXPECT_FALSE(published_threshold_hz(RateSeries::kHapticRate, Fingers::of("index")));
}

TEST(RateExperiment, TooFewSubjectsGetNoPValue) {
  SimulatedSubject subject(plate(), {{1, {23.3, 0.1, 0}}, {2, {8.8, 0.1, 0}}}, 3);
  RateProtocol protocol;
  protocol.fingers = {1, 2};
  protocol.trials = 10;
  const std::vector<RateSession> one{run_rate_session(subject, protocol)};
  const RateComparison found = compare_fingers(one);
  EXPECT_FALSE(found.pairs.at(0).adjusted_p);
  EXPECT_FALSE(found.pairs.at(0).of_log10.why_no_test.empty());
  protocol.fingers = {1, 1};
  EXPECT_THROW(run_rate_session(subject, protocol), UsageError);
  EXPECT_THROW(protocol.fingers = {6}, UsageError);
}

TEST(Plate, IsPressedByNamedFingersAroundItsMiddle) {
  for (const PublishedThreshold& one : published_thresholds(RateSeries::kExclusion)) {
    const std::vector<sim::Pose> poses = plate().pressing(one.fingers, kMostPressN);
    ASSERT_EQ(poses.size(), one.fingers.count());
    Vector3 middle = Vector3::Zero();
    for (const sim::Pose& pose : poses) middle += pose.position_m / static_cast<double>(poses.size());
    EXPECT_LE(middle.head<2>().cwiseAbs().maxCoeff(), 0.005 + 1e-9) << one.fingers.text();
    PlateForces contact(plate(), poses);
    std::vector<Vector3> forces_n(poses.size());
    contact.forces(poses, 1e-3, forces_n);
    for (const Vector3& force_n : forces_n) EXPECT_NEAR(force_n.z(), kMostPressN, 2e-3) << one.fingers.text();
  }
}

TEST(RateExperiment, NamedFingersAndPairsAreAskedAndComparedAsInTable1) {
  // Thresholds that are the published means: what is reported is told apart by name.
  std::vector<ConditionMean> means;
  RateProtocol protocol;
  protocol.series = RateSeries::kExclusion;
  protocol.trials = 40;
  protocol.fingers.clear();
  for (const PublishedThreshold& one : published_thresholds(RateSeries::kExclusion)) {
    means.push_back({one.fingers, one.mean_hz});
    protocol.fingers.push_back(one.fingers);
  }
  const auto group = scaled_group(means, 3, 0.02, 0.08, 0.02, 3);
  std::vector<RateSession> sessions;
  for (std::size_t i = 0; i < group.size(); ++i) {
    SimulatedSubject subject(plate(), group[i], static_cast<std::uint32_t>(i));
    sessions.push_back(run_rate_session(subject, protocol));
  }
  const RateComparison found = compare_fingers(sessions);
  ASSERT_EQ(found.groups.size(), 6U);
  EXPECT_EQ(found.pairs.size(), 15U);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(found.groups[i].fingers, protocol.fingers[i]);
    EXPECT_NEAR(found.groups[i].hz.mean / means[i].hz, 1, 0.12) << found.groups[i].fingers.text();
  }
  const auto sides = compare_single_and_several(sessions);
  ASSERT_TRUE(sides && sides->test);
  EXPECT_NEAR(sides->test->degrees_of_freedom, 10, 8);
  EXPECT_LT(sides->test->p, 0.01);
  protocol.fingers = {1};
  SimulatedSubject alone(plate(), {{1, {23.3, 0.1, 0}}}, 3);
  EXPECT_FALSE(compare_single_and_several(std::vector{run_rate_session(alone, protocol)}));
}

TEST(RateExperiment, AGroupIsDrawnWithThePublishedMeansAndSpreads) {
  const std::vector<PublishedThreshold> table = published_thresholds(RateSeries::kExclusion);
  const auto group = drawn_group(table, 4000, 0.08, 0.02, 7);
  for (const PublishedThreshold& one : table) {
    std::vector<double> hz, logs;
    for (const SubjectFunctions& subject : group) {
      hz.push_back(subject.at(one.fingers).threshold_hz);
      logs.push_back(std::log(hz.back()));
      ASSERT_GE(hz.back(), kLeastThresholdHz);
      ASSERT_LE(hz.back(), kMostThresholdHz);
    }
    // The median of what is left of the population between the least and the most; its spread is less.
    std::ranges::nth_element(logs, logs.begin() + 2000);
    const LogNormal population = log_normal(one.mean_hz, *one.sd_hz);
    const boost::math::normal log_hz(population.location, population.spread);
    const double median =
        boost::math::quantile(log_hz, (boost::math::cdf(log_hz, std::log(kLeastThresholdHz)) +
                                       boost::math::cdf(log_hz, std::log(kMostThresholdHz))) /
                                          2);
    EXPECT_NEAR(logs[2000], median, 0.08) << one.fingers.text();
    const SampleSummary found = summary_of(hz);
    EXPECT_LT(found.standard_deviation, *one.sd_hz) << one.fingers.text();
    EXPECT_GT(found.standard_deviation, 0.5 * *one.sd_hz) << one.fingers.text();
    RecordProperty("sd_of_" + one.fingers.text(), std::to_string(found.standard_deviation));
  }
  EXPECT_THROW((void)drawn_group(published_thresholds(RateSeries::kHapticRate), 3, 0.08, 0.02, 7),
               UsageError);
}

}  // namespace
}  // namespace kiroku::trainer
