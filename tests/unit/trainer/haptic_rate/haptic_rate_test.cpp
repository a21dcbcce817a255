#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"
#include "trainer/haptic_rate/experiment.h"
#include "trainer/haptic_rate/held_forces.h"
#include "trainer/psychophysics/rate_series.h"

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
  SimulatedSubject subject(plate(), {{8.8, 0.01, 0}}, 1);
  EXPECT_TRUE(subject.feels_vibration(1, 5.1));
  EXPECT_FALSE(subject.feels_vibration(1, 31));
  EXPECT_THROW((void)subject.feels_vibration(2, 10), UsageError);
  EXPECT_THROW(SimulatedSubject(plate(), {{0, 0.1, 0}}, 1), UsageError);
  EXPECT_THROW(SimulatedSubject(plate(), {{3, 0.1, 1}}, 1), UsageError);
}

TEST(RateExperiment, ThePapersMeansFallOutOfSubjectsThatHaveThem) {
  const std::vector<double> means_hz{23.3, 8.8, 3.0, 1.3, 1.2};
  const auto functions = simulated_group(means_hz, 6, 0.05, 0.08, 0.02, 5);
  for (std::size_t count = 0; count < means_hz.size(); ++count) {
    double sum = 0;
    for (const auto& subject : functions) sum += subject[count].threshold_hz;
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
    if (pair.second == 5 && pair.first == 4) continue;  // 1.3 and 1.2 Hz
    EXPECT_LT(*pair.adjusted_p, 0.01) << pair.first << " " << pair.second;
    EXPECT_GE(*pair.adjusted_p, pair.of_log10.test->p);
  }
}

TEST(RateExperiment, EachStudyHasItsOwnThresholds) {
  EXPECT_EQ(published_threshold_hz(RateSeries::kHapticRate, 1), 23.3);
  EXPECT_EQ(published_threshold_hz(RateSeries::kHapticRate, 5), 1.2);
  EXPECT_EQ(published_threshold_hz(RateSeries::kExclusion, 1), 15.8);
  EXPECT_EQ(published_threshold_hz(RateSeries::kExclusion, 2), 4.2);
  EXPECT_FALSE(published_threshold_hz(RateSeries::kExclusion, 3));
  EXPECT_FALSE(published_threshold_hz(RateSeries::kHapticRate, 0));
  EXPECT_FALSE(published_threshold_hz(RateSeries::kHapticRate, 6));
}

TEST(RateExperiment, TooFewSubjectsGetNoPValue) {
  SimulatedSubject subject(plate(), {{23.3, 0.1, 0}, {8.8, 0.1, 0}}, 3);
  RateProtocol protocol;
  protocol.fingers = {1, 2};
  protocol.trials = 10;
  const std::vector<RateSession> one{run_rate_session(subject, protocol)};
  const RateComparison found = compare_fingers(one);
  EXPECT_FALSE(found.pairs.at(0).adjusted_p);
  EXPECT_FALSE(found.pairs.at(0).of_log10.why_no_test.empty());
  protocol.fingers = {1, 1};
  EXPECT_THROW(run_rate_session(subject, protocol), UsageError);
  protocol.fingers = {6};
  EXPECT_THROW(run_rate_session(subject, protocol), UsageError);
}

}  // namespace
}  // namespace kiroku::trainer
