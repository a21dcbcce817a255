#include "viewer/compare/figures.h"

#include "media/vital_line.h"
#include "tests/support/nanoseconds.h"
#include "tests/support/recorded_case.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::compare {
namespace {

using testing::ElementsAre;

constexpr const char* kSystolic = "MDC_PRESS_BLD_ART_ABP_SYS";

const std::vector<PlannedStep> kStepsOfFigures{{"a", 0, 2}, {"b", 2, 1}, {"c", 3, 4}};

StepMatching two_steps() {
  StepMatch second, first;
  second.step = 1;
  second.span = {100 * kSecond, 110 * kSecond};
  second.pauses = {{102 * kSecond, 105 * kSecond}};
  second.end_from = KnownFrom::kHand;
  first.step = 0;
  first.span = {130 * kSecond, 160 * kSecond};
  first.end_from = KnownFrom::kHand;
  return match_by_hand(kStepsOfFigures, {first, second}, 200 * kSecond);
}

/// A value a second from 0 to 200 s.
template <typename Value>
VitalSeries series(const Value& value) {
  VitalSeries made{"systolic", "mm[Hg]", {}};
  for (int second = 0; second < 200; ++second) made.numbers.push_back({second * kSecond, value(second)});
  return made;
}

TEST(Figures, StateOrderPausesAndTheChangeOfVitalSigns) {
  CaseRecord record;
  record.vitals[{kSystolic, ""}] = series([](int second) {
    return second < 100 ? 120.0 : second < 110 ? 100 : 130;
  });
  const std::vector<StepFigures> figures = figures_of(kStepsOfFigures, two_steps(), record);
  ASSERT_EQ(figures.size(), 3U);
  EXPECT_EQ(figures[0].done_as, 1U);
  EXPECT_EQ(figures[0].pause_before_ns, 20 * kSecond);
  EXPECT_EQ(figures[1].done_as, 0U);
  EXPECT_FALSE(figures[1].pause_before_ns.has_value());
  EXPECT_EQ(figures[1].pauses_within_ns, 3 * kSecond);
  EXPECT_FALSE(figures[2].done_as.has_value());
  EXPECT_TRUE(figures[2].vitals.empty());
  ASSERT_EQ(figures[1].vitals.size(), 1U);
  EXPECT_EQ(figures[1].vitals[0].before, 120);
  EXPECT_EQ(figures[1].vitals[0].during, 100);
  EXPECT_EQ(figures[1].vitals[0].after, 130);
}

TEST(Figures, ApauseIsNotKnownWhereNobodySaidWhenTheStepBeforeEnded) {
  StepMatch a, b;
  a.step = 0;
  a.span = {10, 9};
  b.step = 1;
  b.span = {50, 60};
  const StepMatching matching = match_by_hand(kStepsOfFigures, {a, b}, 100);
  EXPECT_FALSE(figures_of(kStepsOfFigures, matching, {})[1].pause_before_ns.has_value());
}

TEST(Figures, TellPressuresThatPassTheirLimitsAndAlarms) {
  CaseRecord record;
  record.vitals[{kSystolic, ""}] = series([](int second) {
    return second < 10 ? 80.0 : second < 20 ? 120 : second < 25 ? 88 : 161;
  });
  record.vitals[{"MDC_PRESS_BLD_ART_ABP_MEAN", ""}] =
      series([](int second) { return second < 30 ? 9.0 : 8; });
  record.vitals[{"MDC_PRESS_BLD_ART_ABP_MEAN", ""}].unit = "kPa";
  record.vitals[{"MDC_PRESS_BLD_ART_PULM_MEAN", ""}] = series([](int) { return 12.0; });
  record.alarms = {{15 * kSecond, kSystolic, "ABP high", "PM"},
                   {16 * kSecond, "MDC_ECG_HEART_RATE", "HR", ""}};
  const auto events = pressure_events(record, 0, 200 * kSecond);
  std::vector<std::string> texts;
  for (const PressureEvent& event : events)
    texts.push_back(std::to_string(event.time_ns / kSecond) + " " + event.text);
  EXPECT_THAT(texts, ElementsAre("0 systolic pressure 80.0 mmHg, below 90", "15 ABP high",
                                 "20 systolic pressure 88.0 mmHg, below 90",
                                 "25 systolic pressure 161.0 mmHg, above 160",
                                 "30 mean pressure 60.0 mmHg, below 65"));
  EXPECT_TRUE(events[1].is_alarm);
  // What had passed before is no event of the time that follows.
  EXPECT_TRUE(pressure_events(record, 26 * kSecond, 30 * kSecond).empty());
}

// "None" of a pressure that nobody measured, or of one that was low all the while, is believed.
TEST(Figures, SayWhetherAPressureWasMeasuredAndWhatWasBeyondALimitAlready) {
  CaseRecord record;
  EXPECT_FALSE(figures_of(kStepsOfFigures, two_steps(), record)[1].measured.judged);
  record.vitals[{kSystolic, ""}] = series([](int second) { return second < 90 ? 120.0 : 55; });
  const StepFigures low = figures_of(kStepsOfFigures, two_steps(), record)[1];
  EXPECT_TRUE(low.measured.judged);
  ASSERT_EQ(low.pressure.size(), 1U);
  EXPECT_EQ(low.pressure[0].text, "systolic pressure 55.0 mmHg, already below 90");
  EXPECT_EQ(low.pressure[0].time_ns, 100 * kSecond);
  record.vitals[{kSystolic, ""}].unit = "furlong";
  const StepFigures unread = figures_of(kStepsOfFigures, two_steps(), record)[1];
  EXPECT_FALSE(unread.measured.judged);
  EXPECT_THAT(unread.measured.unread_units, ElementsAre("furlong"));
  EXPECT_TRUE(unread.pressure.empty());
}

TEST(Figures, TakeKilopascalHoweverItIsWritten) {
  EXPECT_NEAR(mmhg_of(16, "kPa").value(), 120, 0.1);
  EXPECT_NEAR(mmhg_of(16, "kpa").value(), 120, 0.1);
  EXPECT_EQ(mmhg_of(16, "mm[Hg]"), 16);
  EXPECT_EQ(mmhg_of(16, "mmHg"), 16);
  EXPECT_FALSE(mmhg_of(16, "").has_value());
  CaseRecord record;
  record.vitals[{kSystolic, ""}] = series([](int) { return 16.0; });
  record.vitals[{kSystolic, ""}].unit = "kpa";
  EXPECT_TRUE(figures_of(kStepsOfFigures, two_steps(), record)[1].pressure.empty()) << "16 kPa are 120 mmHg";
}

TEST(CaseRecord, IsWhatTheCaseHoldsOfMarksNumbersAndAlarms) {
  const test::TemporaryFolder folder;
  const test::Reader reader = test::make_reader();
  const std::string salt(64, '0');
  const std::string events =
      R"({"salt":")" + salt +
      R"(","event":"{\"time_ns\":1500000000,\"utc\":\"2026-08-05T09:15:03.500000Z\",\"kind\":\"mark\",\"text\":\"clip \\\"a\\\"\"}"})" +
      "\n" + R"({"salt":")" + salt +
      R"(","event":"{\"time_ns\":2,\"kind\":\"subject-missing\",\"text\":\"x\"}"})" + "\n";
  std::string vitals;
  media::VitalSample sample;
  sample.time_ns = 10;
  sample.code = "MDC_ECG_HEART_RATE";
  sample.mdc = 147842;
  sample.value = 72;
  sample.unit = "/min";
  const auto add = [&](const media::VitalLine& line) { vitals += media::to_json_line(line) + "\n"; };
  add(sample);
  sample.source = "oximeter";
  sample.value = 75;
  add(sample);
  sample.quality = media::VitalQuality::kInvalid;
  add(sample);
  sample.quality = media::VitalQuality::kQuestionable;
  sample.value = 18;
  add(sample);
  add(sample);
  media::VitalSample wave = sample;
  wave.value.reset();
  wave.quality = media::VitalQuality::kGood;
  wave.rate_hz = 100;
  wave.values = {1, 2, 3};
  add(wave);
  media::DeviceAlarm alarm;
  alarm.time_ns = 20;
  alarm.code = "MDC_EVT_LO";
  alarm.about = kSystolic;
  alarm.text = "ABP low";
  alarm.phase = "start";
  add(alarm);
  alarm.quality = media::VitalQuality::kQuestionable;
  alarm.text = "of an earlier patient";
  add(alarm);
  alarm.phase = "end";
  add(alarm);
  const auto recording = archive::CaseReader::open(
      test::record_case(folder / "archive",
                        {{"events", "events", "application/jsonl", {to_bytes(events)}, {2}},
                         {"vitals", "vitals", "application/jsonl", {to_bytes(vitals)}, {8}}},
                        reader.recipients));
  const CaseRecord record = read_case_record(recording, reader.identities);
  EXPECT_THAT(record.marks, ElementsAre(Mark{1'500'000'000, "clip \"a\""}));
  EXPECT_EQ(record.events_lacking, 0U);
  ASSERT_EQ(record.vitals.size(), 2U) << "two devices are two series";
  const auto& [key, of_monitor] = *record.vitals.begin();
  EXPECT_EQ(key.device, "oximeter");
  EXPECT_EQ(of_monitor.label, "heart rate");
  EXPECT_EQ(of_monitor.told_device, "oximeter");
  EXPECT_EQ(of_monitor.numbers.size(), 1U);
  EXPECT_EQ(std::next(record.vitals.begin())->second.told_device, "vitals")
      << "who does not say is its stream";
  ASSERT_EQ(record.alarms.size(), 1U);
  EXPECT_EQ(record.alarms[0].text, "ABP low");
  EXPECT_EQ(record.left_out, (LeftOut{2, 1, 1})) << "neither means nor limits rest on these";
}

}  // namespace
}  // namespace kiroku::compare
