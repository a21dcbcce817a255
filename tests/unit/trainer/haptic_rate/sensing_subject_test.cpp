#include "trainer/haptic_rate/sensing_subject.h"

#include <cmath>

#include <gtest/gtest.h>

#include "base/error.h"
#include "trainer/haptic_rate/experiment.h"
#include "trainer/haptic_rate/pressing_hand.h"

namespace kiroku::trainer {
namespace {

const Plate& pressed_plate() {
  static const Plate kPlate;
  return kPlate;
}

/// One that calls vibrating what makes one finger's threshold the haptic-rate study's.
const SensingModel& strict() {
  static const SensingModel kModel = [] {
    SensingModel model;
    model.keener_db = keener_for(pressed_plate(), 1, 23.3, model);
    return model;
  }();
  return kModel;
}

TEST(SensingSubject, FeelsLowRatesMore) {
  SensingModel model;
  model.device_hz = 10;
  double before = std::numeric_limits<double>::infinity();
  for (const double rate_hz : {3.0, 6.0, 15.0, 28.0, 100.0}) {
    const double level_db = felt_level_db(pressed_plate(), 1, rate_hz, model);
    EXPECT_LT(level_db, before) << rate_hz;
    before = level_db;
  }
}

TEST(SensingSubject, IsAskedAsTheOthersAreAndAnswersByItsLevel) {
  const SensingModel model = strict();
  const PredictedThreshold predicted =
      predicted_threshold(pressed_plate(), RateSeries::kHapticRate, 1, model);
  ASSERT_TRUE(predicted.hz);
  EXPECT_NEAR(felt_level_db(pressed_plate(), 1, *predicted.hz, model), 0, 3);
  SensingSubject subject(pressed_plate(), model, 4);
  RateProtocol protocol;
  protocol.fingers = {1};
  const RateSession session = run_rate_session(subject, protocol);
  EXPECT_NEAR(std::log10(session.thresholds[0].estimate.hz / *predicted.hz), 0, 0.1);
}

TEST(SensingSubject, AKeenerOneIsFeltAtHigherRatesAndASlowDeviceAtLowerOnes) {
  const auto threshold = [](const SensingModel& model) {
    return predicted_threshold(pressed_plate(), RateSeries::kHapticRate, 1, model).hz.value();
  };
  const double plain_hz = threshold(strict());
  EXPECT_NEAR(plain_hz / 23.3, 1, 0.1);  // the series' rates lie that far apart
  SensingModel keener = strict();
  keener.keener_db += 2;
  EXPECT_GT(threshold(keener), plain_hz);
  SensingModel slow = strict();
  slow.device_hz = 20;
  EXPECT_LT(threshold(slow), plain_hz);
}

TEST(SensingSubject, KeennessAndThePacinianLevelAreTheSame) {
  // So that what is unknown of one is tried with the other: each curve hangs on P's level.
  SensingModel keener, deeper;
  keener.keener_db = 7;
  deeper.curves.pacinian_best_db -= 7;
  for (const double hz : {1.0, 10.0, 60.0})
    EXPECT_NEAR(felt_level_db(pressed_plate(), 1, hz, keener), felt_level_db(pressed_plate(), 1, hz, deeper),
                1e-9);
}

TEST(SensingSubject, MaskingRaisesThresholdsOfSeveralFingersAlone) {
  SensingModel masked = strict();
  masked.masking_db = 6;
  EXPECT_EQ(felt_level_db(pressed_plate(), 1, 6, masked), felt_level_db(pressed_plate(), 1, 6, strict()));
  // Two neighbours: each by all of it. Three: those at the edge by the neighbour and half for the one beyond.
  const Fingers pair = Fingers::of("index+middle"), three = Fingers::of("index+middle+third");
  EXPECT_NEAR(
      felt_level_db(pressed_plate(), pair, 6, strict()) - felt_level_db(pressed_plate(), pair, 6, masked), 6,
      1e-9);
  EXPECT_GE(
      felt_level_db(pressed_plate(), three, 6, strict()) - felt_level_db(pressed_plate(), three, 6, masked),
      9 - 1e-9);
  SensingModel fitted = strict();
  fitted.masking_db = masking_for(pressed_plate(), pair, 4.9, strict()).value();
  EXPECT_NEAR(felt_level_db(pressed_plate(), pair, 4.9, fitted), 0, 1e-9);
  EXPECT_FALSE(masking_for(pressed_plate(), 1, 4.9, strict()));
}

TEST(SensingSubject, CurvesOfTouchDoNotExplainWhatTheStudiesFound) {
  const std::vector<PublishedThreshold> study = published_thresholds(RateSeries::kHapticRate);
  // Nothing put in: one finger feels every rate of the series.
  double least_db = std::numeric_limits<double>::infinity(), least_at_study_db = least_db;
  for (const TouchCurves& curves : touch_curves_to_try()) {
    SensingModel model;
    model.curves = curves;
    least_db = std::min(least_db, felt_level_db(pressed_plate(), 1, 100, model));
    least_at_study_db =
        std::min(least_at_study_db, felt_level_db(pressed_plate(), 1, study[0].mean_hz, model));
    EXPECT_TRUE(predicted_threshold(pressed_plate(), RateSeries::kHapticRate, 1, model).all_are_felt);
  }
  RecordProperty("level_at_100_hz_db", std::to_string(least_db));
  RecordProperty("level_at_study_db", std::to_string(least_at_study_db));
  // Whatever is called vibrating: more fingers do not make a threshold fall as the study found.
  for (std::size_t fingers = 2; fingers <= kMostFingers; ++fingers) {
    const double paper_hz = study[fingers - 1].mean_hz;
    const PredictedRange predicted =
        predicted_beside(pressed_plate(), RateSeries::kHapticRate, fingers, 1, study[0].mean_hz, {});
    const std::string name = "fingers_" + std::to_string(fingers);
    RecordProperty(name + "_least_hz", std::to_string(predicted.least_hz));
    RecordProperty(name + "_most_hz", std::to_string(predicted.most_hz));
    RecordProperty(name + "_masking_db",
                   std::to_string(masking_for(pressed_plate(), fingers, paper_hz, strict()).value_or(-1)));
    EXPECT_GT(predicted.least_hz, 2 * paper_hz) << fingers;
  }
}

TEST(SensingSubject, AStrokeNeedsHigherRatesAsTheStudiesExpect) {
  SensingModel stroking;
  stroking.manner = Manner::kStroke;
  const double gain_db =
      felt_level_db(pressed_plate(), 1, 23.3, stroking) - felt_level_db(pressed_plate(), 1, 23.3, {});
  RecordProperty("stroked_gain_db", std::to_string(gain_db));
  EXPECT_GT(gain_db, 6);
  EXPECT_GT(predicted_beside(pressed_plate(), RateSeries::kHapticRate, 1, 1, 23.3, stroking).least_hz,
            2 * 23.3);
}

TEST(SensingSubject, RefusesAModelWithoutSense) {
  for (const auto& spoil :
       std::initializer_list<void (*)(SensingModel&)>{[](SensingModel& model) { model.device_hz = 0; },
                                                      [](SensingModel& model) { model.masking_db = -1; },
                                                      [](SensingModel& model) { model.spread_db = 0; },
                                                      [](SensingModel& model) { model.lapse_rate = 1; }}) {
    SensingModel model;
    spoil(model);
    EXPECT_THROW((void)felt_level_db(pressed_plate(), 1, 10, model), UsageError);
    EXPECT_THROW(SensingSubject(pressed_plate(), model, 1), UsageError);
  }
  EXPECT_THROW((void)manner_of("pat"), UsageError);
  EXPECT_EQ(manner_of("stroke"), Manner::kStroke);
}

TEST(SensingGroup, DiffersByWhatItIsAskedTo) {
  const std::vector<SensingModel> group = sensing_group({}, 400, 3, 1);
  std::vector<double> keener_db;
  for (const SensingModel& one : group) keener_db.push_back(one.keener_db);
  const SampleSummary found = summary_of(keener_db);
  EXPECT_NEAR(found.mean, 0, 0.4);
  EXPECT_NEAR(found.standard_deviation, 3, 0.3);
}

}  // namespace
}  // namespace kiroku::trainer
